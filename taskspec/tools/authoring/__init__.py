"""Specs while they are typed: partial documents, names by place, completion, meanings and fixes; without a protocol.

Everything here takes a text and an offset in it, and never raises for a bad text.
"""
