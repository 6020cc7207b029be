"""What the program should reach on two cores, beside what it reached."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from tests.benchmarks.runs import PAPER_INTERNODES

#: A stand of at least so many metamers with a living site is held to the cost of a large one.
_LARGE = 5_000_000
_FRAME_TREES = 10_000
_SCENE_HECTARES = 0.9  # a scene of so many is held to the time of one
_HECTARE = {"plot_m": 100.0, "years": 100}


class Verdict(NamedTuple):
    """A measured value and its limit; `sign` is ≤ or ≥."""

    name: str
    value: float
    sign: str
    limit: float

    @property
    def met(self) -> bool:
        """Whether the value keeps to the limit."""
        return self.value <= self.limit if self.sign == "≤" else self.value >= self.limit


def verdicts(result: dict[str, Any]) -> Iterator[Verdict]:
    """Compare a result with its targets; those of what was not measured are left out."""
    tree, run, starts = result["paper_tree"], result["run"], result["starts"]
    yield Verdict("paper tree: internodes", tree["internodes"], "≥", PAPER_INTERNODES)
    yield Verdict("paper tree, s", tree["seconds"], "≤", 2.0)
    if all(run[key] == value for key, value in _HECTARE.items()):
        yield Verdict("hectare of 100 years, s", run["seconds"], "≤", 120.0)
        yield Verdict("hectare of 100 years, peak GB", run["peak_gb"], "≤", 3.0)
    large = result["stands"][-1]
    if large["metamers_with_site"] >= _LARGE:
        year = large["threads"][max(large["threads"])]["year"]
        yield Verdict("large stand, ns per metamer-year", year["wall_ns"], "≤", 100.0)
        per_site = year["wall_ns_per_site_metamer"]
        yield Verdict("the same, per metamer with a living site", per_site, "≤", 100.0)
    memory = large["memory"]
    yield Verdict("arena, bytes per metamer", memory["arena_bytes"], "≤", 80.0)
    yield Verdict("process, bytes per metamer", memory["process_bytes"], "≤", 120.0)
    yield Verdict("exponent of cost", max(result["exponent"].values()), "≤", 1.05)
    if "gain" in large:
        yield Verdict("2 threads over 1", large["gain"]["year"], "≥", 1.4)
    bending = result["bending"]
    timed = bending["threads"][max(bending["threads"])]
    # ns per metamer are ms per million
    yield Verdict("a year's bending, s per million metamers", timed["bend_ns"] / 1e3, "≤", 1.0)
    yield Verdict("the same, aim", timed["bend_ns"] / 1e3, "≤", 0.6)
    changed = timed["again_ns"] / timed["wall_ns"]["settle"]
    yield Verdict("settling where nothing has changed, of a year's", changed, "≤", 0.5)
    viewer = result["viewer"]
    yield Verdict("viewer: opening a hectare, s", viewer["open_s"], "≤", 10.0)
    yield Verdict("viewer: another year, s", viewer["year_s"], "≤", 0.3)
    yield Verdict("viewer: frames per second", 1.0 / viewer["frame_s"], "≥", 15.0)
    if viewer["browser_fps"] == viewer["browser_fps"]:  # NaN without a browser
        yield Verdict("viewer: the same in a browser", viewer["browser_fps"], "≥", 15.0)
    scene = result["scene"]
    if scene["hectares"] >= _SCENE_HECTARES:
        yield Verdict("scene of a hectare, s", scene["seconds"], "≤", 20.0)
    frames = result["frames"]
    if frames["trees"] >= _FRAME_TREES:
        frame = frames["threads"][max(frames["threads"])]
        yield Verdict("a frame of 10,000 trees, s", frame["shaded_s"], "≤", 2.0)
    surfaces = result["surfaces"]
    yield Verdict("tubes of 50,000 internodes, s", surfaces["tubes_s"], "≤", 1.0)
    yield Verdict("its blended surface, s", surfaces["blended_s"], "≤", 60.0)
    yield Verdict("its blended surface, GiB", surfaces["blended_gib"], "≤", 4.0)
    maps = result["bark_maps"]
    yield Verdict("4K set of a trunk, s", maps["maps_s"] + maps["save_s"], "≤", 10.0)
    yield Verdict("bark of 225 strips, s", result["bark"]["225 strips"]["wall_s"], "≤", 2.0)
    yield Verdict("share of writing", run["writing_share"], "≤", 0.10)
    yield Verdict("cold start, s", starts["cold_s"], "≤", 45.0)
    yield Verdict("warm start, s", starts["warm_s"], "≤", 2.0)
    yield Verdict("forest --help, s", starts["help_s"], "≤", 0.5)
