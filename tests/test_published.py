"""Every number of the page on validation (docs/published) is as close to the published one as it says."""

import pytest

from docs.published import Case, Row, Summary, events, frequencies, orders, printed, source


@pytest.mark.parametrize("chapter", [source, frequencies, events, orders], ids=lambda m: m.__name__.split(".")[-1])
def test_published_numbers_are_met(chapter):
    for case in chapter.cases():
        for row in case.rows:
            assert row.difference <= row.allowed, f"{case.title}: {row.quantity}"


def test_a_rounded_number_may_differ_by_half_a_unit_of_its_last_digit():
    near, far = (Case("f", "", (printed("f1", "2.6", f, "Hz"),)) for f in (2.6499, 2.6501))
    assert near.holds
    assert not far.holds


def test_the_summary_counts_what_is_not_met():
    case = Case("f", "", (Row("f1", 1.0, 1.0, "Hz", 0.1), Row("f2", 2.0, 3.0, "Hz", 0.1)))
    assert Summary({"chapter": [case]})._repr_markdown_().splitlines()[-1] == "| chapter | 1 | 2 | 1 |"


def test_the_table_shows_the_printed_digits_and_one_more_of_ours():
    case = Case("Frequencies", "a book", (printed("f1", "2.6", 2.63774, "Hz"),))
    assert case._repr_markdown_().splitlines()[-1] == "| f1 [Hz] | 2.6 | 2.638 | 3.8e-02 | 5.0e-02 |"
