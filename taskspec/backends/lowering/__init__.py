"""What is done to a task's expressions before code is made of them, for several backends."""
