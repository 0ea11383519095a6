"""What the compiler makes of a spec beside what the second interpreter says."""
