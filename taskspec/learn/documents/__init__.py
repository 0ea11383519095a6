"""Files of experiments, exams and findings: their shapes, and the rules in them."""
