"""The report of a diagnosis."""


def report_html(d):
    """Stub."""
    return "<html></html>"


def _(d):
    return "<html></html>"
