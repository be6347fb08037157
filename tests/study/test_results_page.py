"""The page of results: made anew, with what was written by hand kept."""

from scripts.results_page import BEGIN, END, page

REPORT = "# A study\n\nNumbers.\n\n![x](figures/x.png)\n"


def test_what_is_written_by_hand_stays() -> None:
    first = page(REPORT, "")
    assert first.startswith("# Results\n")
    assert "](results/x.png)" in first
    assert "# A study" not in first
    by_hand = first.replace("# Results\n", "# Results\n\nWe read.\n").replace(END, f"{END}\n\nAnd close.")
    again = page(REPORT.replace("Numbers", "Other numbers"), by_hand)
    assert "We read." in again.partition(BEGIN)[0]
    assert "And close." in again.partition(END)[2]
    assert "Other numbers" in again
    assert page(REPORT, again) == by_hand


def test_the_command_has_no_folders_of_a_machine() -> None:
    report = "# A study\n\n    drlsl study --test /data/us101 --out /home/me/runs/paper\n\n1 /a/b\n"
    made = page(report, "")
    assert "drlsl study --test us101 --out paper\n" in made
    assert "1 /a/b" in made
