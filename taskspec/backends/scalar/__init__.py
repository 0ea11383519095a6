"""The scalar program: generated Python that resets and steps one environment."""
