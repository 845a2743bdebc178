"""What a user declares: frozen data and its checks. A new pair type, load or motion law is a row or a small class here."""
