"""Every small change of a spec, and what notices the change."""
