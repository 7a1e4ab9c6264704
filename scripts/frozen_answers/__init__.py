"""Answers of some 300 studies, frozen in a table, and what differs from them."""
