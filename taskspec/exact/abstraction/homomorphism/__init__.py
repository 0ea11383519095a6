"""That an abstraction is a homomorphism of tasks: the task over the mapped state, compared with the stand-in."""
