"""The language server: `taskspec.analysis` for editors that speak the Language Server Protocol; pygls is imported here."""
