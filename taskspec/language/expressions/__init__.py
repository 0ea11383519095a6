"""The expression language: text -> syntax -> typed core, its tables, and its reference interpreter."""
