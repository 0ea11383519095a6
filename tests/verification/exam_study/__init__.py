"""A mutation study of the exam: learners that are right, mistakes that are made in them, and which of these the exam flags."""
