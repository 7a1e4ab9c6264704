"""The public names, however and whenever they are first used."""

import fes_pin as fp


def test_every_public_name_can_be_had():
    for name in fp.__all__:
        assert getattr(fp, name) is not None


def test_diagnose_can_be_called_after_its_chapter_was_imported():
    import fes_pin.diagnose.diagnosis  # noqa: F401

    assert callable(fp.diagnose)
    assert callable(fp.diagnose)
