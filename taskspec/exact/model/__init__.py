"""The exact model of a finite task: its states, its transitions with their probabilities, its rewards."""
