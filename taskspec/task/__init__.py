"""From a document and parameter values to a task."""
