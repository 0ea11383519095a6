"""Returns, values and policies worked out on a model: in floats, in fractions, or between bounds that are certain."""
