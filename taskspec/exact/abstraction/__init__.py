"""Tasks solved through a finite abstraction, whether it is faithful, and symmetries."""
