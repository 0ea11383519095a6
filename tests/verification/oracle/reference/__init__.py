"""A second interpreter of specs: slow, obvious, and written from the documentation alone.

It imports nothing of taskspec (a test looks), so that where both agree, the documentation, the compiler and this
reading of it say the same thing.
"""
