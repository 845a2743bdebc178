"""What a user declares: frozen data and its checks. A new load or motion law is a small class here."""
