"""How values of options are read and options are spelled, without the command line around them."""

from decimal import Decimal
from fractions import Fraction

import pytest

from robust.errors import InputError, Location
from robust.options import as_typed, exact, place_of, plot_file, positive, spelled

PLACE = Location("beta")


def test_messages_spell_options_as_they_were_typed():
    assert spelled("time_limit") == "time_limit"
    with as_typed(["time_limit"]):
        assert spelled("time_limit") == "--time-limit"
        assert place_of("time_limit") == Location("--time-limit")
        assert place_of("time_limit", "soon") == Location("--time-limit 'soon'")
    assert spelled("time_limit") == "time_limit"


@pytest.mark.parametrize(
    ("value", "number"),
    [(3, 3), (Fraction(1, 3), Fraction(1, 3)), ("0.1", Fraction(1, 10)), (0.1, Fraction(1, 10)), (Decimal("1E2"), 100)],
)
def test_numbers_are_exact(value, number):
    assert exact(value, PLACE) == number
    assert isinstance(exact(value, PLACE), Fraction)
    assert positive(value, PLACE) == number


@pytest.mark.parametrize("value", [True, None, [1], "one"])
def test_what_is_no_number_is_refused(value):
    with pytest.raises(InputError, match=r"^beta: found .*, expected"):
        exact(value, PLACE)


@pytest.mark.parametrize("value", [0, -1, "-1/2"])
def test_not_positive(value):
    with pytest.raises(InputError, match=f"^beta: found '{value}', expected a number above 0"):
        positive(value, PLACE)


def test_plot_files(tmp_path):
    for name in ("a.svg", "a.PNG", "a.pdf"):
        assert plot_file(str(tmp_path / name), PLACE) == tmp_path / name
    with pytest.raises(InputError, match=r"^beta: found .*, expected a name that ends in \.svg, \.png, \.pdf"):
        plot_file(tmp_path / "a.txt", PLACE)
    with pytest.raises(InputError, match=r"^beta: found no directory .*, expected one to write the plot to"):
        plot_file(tmp_path / "none" / "a.svg", PLACE)
    (tmp_path / "d.svg").mkdir()
    with pytest.raises(InputError, match=r"^beta: cannot write .*, expected a file that can be written"):
        plot_file(tmp_path / "d.svg", PLACE)
