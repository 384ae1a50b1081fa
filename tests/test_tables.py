"""Results that print as a table say what stands in it, once for terminal and notebook."""

from dataclasses import dataclass

import powertrain_ctrl as pt
from powertrain_ctrl.base.tables import Printed, html_table, markdown_table, text_table


@dataclass(frozen=True, repr=False)
class Gears(Printed):
    ratios: tuple[float, ...]
    headers = ("gear", "i [-]")

    def rows(self):
        return ([str(i + 1), f"{ratio:.2f}"] for i, ratio in enumerate(self.ratios))


class Noted(Gears):
    heading, note = "A gearbox", "i < 1 in gear 2 [m/s^2]"


def test_a_result_prints_its_table():
    assert repr(Gears((3.6, 0.8))) == "gear  i [-]\n1      3.60\n2      0.80"
    assert Gears((3.6, 0.8))._repr_html_() == html_table(("gear", "i [-]"), [["1", "3.60"], ["2", "0.80"]])


def test_heading_and_note_stand_above_and_below_it():
    assert repr(Noted((3.6, 0.8))) == "A gearbox\ngear  i [-]\n1      3.60\n2      0.80\ni < 1 in gear 2 [m/s^2]"
    html = Noted((3.6, 0.8))._repr_html_()
    assert html.startswith("<p>A gearbox</p><table>")
    assert html.endswith("</table><p>i &lt; 1 in gear 2 [m/s<sup>2</sup>]</p>")


def test_without_rows_there_is_no_table():
    assert repr(Noted(())) == "A gearbox\ni < 1 in gear 2 [m/s^2]"
    assert "<table>" not in Noted(())._repr_html_()
    assert repr(Gears(())) == ""


def test_every_result_that_prints_a_table_does_it_in_this_way():
    results = (pt.Modes, pt.Response, pt.LoopMargins, pt.RideMetrics, pt.Robustness, pt.ModelComparison)
    for result in results:
        assert issubclass(result, Printed)
        assert result.__repr__ is Printed.__repr__
        assert result._repr_html_ is Printed._repr_html_


def test_numbers_stand_on_the_right_and_names_on_the_left():
    rows = [["clutch", "0.5"], ["tyre", "–"]]
    assert text_table(["what", "value"], rows).splitlines()[1:] == ["clutch    0.5", "tyre        –"]
    assert markdown_table(["what", "value"], rows).splitlines()[1] == "| --- | --: |"
