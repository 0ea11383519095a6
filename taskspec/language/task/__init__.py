"""Tasks, made of documents and parameter values."""
