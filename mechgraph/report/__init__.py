"""The determinacy report: facts, findings, sentences, sections."""
