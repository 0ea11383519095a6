"""Small changes of the source, one at a time, and whether some test notices: `python -m tests.verification.mutants`.

mutmut 3.8 changes what stands in functions, but a third of the language stands in tables of modules; cosmic-ray 8.7 changes files
in place and runs one command for each change, whichever line it is on. Neither draws a sample.
"""
