"""Numbers of answers: those that are printed, compared with those that are saved."""
