"""One file for each physical thing that a nominal model may leave out."""
