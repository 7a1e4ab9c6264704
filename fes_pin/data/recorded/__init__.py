"""Recordings as laboratories have them: other delimiters, decimal commas, other names and units, other file formats.

Nothing of this is guessed while a study is read: the table `[columns]` of its `study.toml` says how. What a file seems
to hold is proposed by `fes-pin new-study`, for a person to look at.
"""
