"""Odd but readable studies and unreadable files, and whether the command line answers each as it should."""
