"""Solvers of finite decision processes, in the field's symbols and in numbers of any kind."""
