"""What answers of the library are held against: measured strengths, rules of thumb."""
