"""The report of a diagnosis."""


def report_html(d):
    return "<html></html>"
