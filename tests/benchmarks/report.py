"""The benchmark's results as one table: on the screen (rich) and for docs/performance.md.

`python -m tests.benchmarks.report out/bench.json` prints the Markdown table of a saved result.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console
from rich.table import Table

from tests.benchmarks.targets import verdicts


class Line(NamedTuple):
    """A row of the table; a section has empty cells."""

    what: str
    cells: tuple[str, ...]


HEADINGS = ("wall", "CPU", "1 thread, wall", "gain", "× touching")


def lines(result: dict[str, Any]) -> Iterator[Line]:
    """Give the table row by row."""
    for stand in result["stands"]:
        yield from _stand_lines(stand)
    yield from _bending_lines(result["bending"])
    yield Line("All stands", ())
    for threads, exponent in result["exponent"].items():
        what = f"exponent of a year's time over metamers, threads: {threads}"
        yield Line(what, (f"{exponent:.3f}",))
    yield from _run_lines(result)
    yield Line("Targets", ())
    for verdict in verdicts(result):
        met = "met" if verdict.met else "MISSED"
        yield Line(verdict.name, (f"{verdict.value:.3g}", f"{verdict.sign} {verdict.limit:g}", met))


def _stand_lines(stand: dict[str, Any]) -> Iterator[Line]:
    one, most = min(stand["threads"]), max(stand["threads"])
    alone, timed = stand["threads"][one], stand["threads"][most]
    share = stand["metamers_with_site"] / stand["metamers"]
    yield Line(
        f"{stand['metamers']:,} metamers ({share:.0%} bear a living site), "
        f"{stand['trees']:,} trees, {stand['plot_m']:g} m square; "
        f"{most} threads; ns per metamer-year",
        (),
    )
    for phase, entry in [*timed["phases"].items(), ("year", timed["year"])]:
        single = alone["year"] if phase == "year" else alone["phases"][phase]
        yield Line(
            "whole year" if phase == "year" else phase,
            (
                f"{entry['wall_ns']:.1f}",
                f"{entry['cpu_ns']:.1f}",
                f"{single['wall_ns']:.1f}",
                f"{stand['gain'][phase]:.2f}" if "gain" in stand else "",
                f"{entry['times_touching']:.1f}" if "times_touching" in entry else "",
            ),
        )
    year = timed["year"]
    yield Line(
        "whole year, per metamer with a living site", (f"{year['wall_ns_per_site_metamer']:.1f}",)
    )
    yield Line("a year, s", (f"{year['seconds']:.3f}",))
    memory = stand["memory"]
    for key, what in _MEMORY.items():
        yield Line(what, (f"{memory[key]:.0f}",))
    yield Line("peak of the process, GB", (f"{memory['process_peak_gb']:.2f}",))
    yield Line(
        f"copying, GB/s ({one} and {most} threads)",
        (f"{timed['bandwidth_gb_s']:.1f}", "", f"{alone['bandwidth_gb_s']:.1f}"),
    )
    yield Line("same bits on 1 and 2 threads", ("yes" if stand["same_bits"] else "NO",))


_MEMORY = {
    "arena_bytes": "arena, bytes per metamer",
    "extents_bytes": "its part given to trees, bytes per metamer",
    "process_bytes": "process, resident bytes per metamer",
    "peak_bytes": "process at its peak, bytes per metamer",
}


def _bending_lines(bending: dict[str, Any]) -> Iterator[Line]:
    one, most = min(bending["threads"]), max(bending["threads"])
    alone, timed = bending["threads"][one], bending["threads"][most]
    yield Line(
        f"A stand that bends: {bending['metamers']:,} metamers; {most} threads; "
        "ns per metamer-year",
        (),
    )
    for part, wall in timed["wall_ns"].items():
        cpu, single = timed["cpu_ns"][part], alone["wall_ns"][part]
        cells = (f"{wall:.1f}", f"{cpu:.1f}", f"{single:.1f}", f"{single / wall:.2f}")
        yield Line(part, cells)
    bend, single = timed["bend_ns"], alone["bend_ns"]
    cells = (f"{bend:.1f}", f"{timed['bend_cpu_ns']:.1f}", f"{single:.1f}", f"{single / bend:.2f}")
    yield Line("whole bending, without stability", cells)
    again = (f"{timed['again_ns']:.1f}", "", f"{alone['again_ns']:.1f}")
    yield Line("settling where nothing has changed", again)
    year = (f"{timed['year_ns']:.1f}", "", f"{alone['year_ns']:.1f}")
    yield Line("whole year", year)
    ratio = (f"{timed['year_ratio']:.2f}", "", f"{alone['year_ratio']:.2f}")
    yield Line("whole year over that without mechanics", ratio)
    passes = (f"{bending['passes']:.2f}", f"{bending['most_passes']}")
    yield Line("passes of a tree, mean and most", passes)
    picture = (f"{timed['picture_ns']:.1f}", "", f"{alone['picture_ns']:.1f}")
    yield Line("rendered light, ns per metamer and direction", picture)
    yield Line("same bits on 1 and 2 threads", ("yes" if bending["same_bits"] else "NO",))


def _run_lines(result: dict[str, Any]) -> Iterator[Line]:
    run = result["run"]
    yield Line(f"Run of {run['years']} years on {run['plot_m']:g} m square, all tables written", ())
    yield Line("whole run, s", (f"{run['seconds']:.1f}", f"{run['cpu_seconds']:.1f}"))
    yield Line("metamers alive at its end", (f"{run['metamers']:,}",))
    yield Line("metamer-years", (f"{run['metamer_years']:,}",))
    yield Line("ns per metamer-year", (f"{run['wall_ns']:.1f}",))
    yield Line("share of writing", (f"{run['writing_share']:.1%}",))
    yield Line("peak of the process, GB", (f"{run['peak_gb']:.2f}",))
    yield Line("run file, MB", (f"{run['file_mb']:.1f}",))
    tree = result["paper_tree"]
    yield Line("One tree in paper mode", ())
    yield Line(
        f"to {tree['internodes']:,} internodes in {tree['steps']} steps, s",
        (f"{tree['seconds']:.2f}", f"{tree['cpu_seconds']:.2f}"),
    )
    yield Line("peak of the process, GB", (f"{tree['peak_gb']:.2f}",))
    forms = result["parametric"]
    yield Line("a parametric aspen, ms", (f"{1e3 * forms['aspen_s']:.1f}",))
    willow = f"a parametric willow of {1e-6 * forms['willow_leaves']:.1f} million leaves, s"
    yield Line(willow, (f"{forms['willow_s']:.2f}",))
    threads = max(int(key.split("_")[2]) for key in forms if key.startswith("thousand_aspens"))
    whole = f"{forms[f'thousand_aspens_{threads}_s']:.1f}"
    yield Line(f"a thousand parametric aspens, {threads} threads, s", (whole,))
    yield Line("an aspen's moment of wind, ms", (f"{1e3 * forms['sway_s']:.1f}",))
    yield from _frame_lines(result["frames"])
    yield from _scene_lines(result["scene"])
    skin = result["surfaces"]
    whole = f"{skin['metamers']:,} internodes, {skin['height_m']:.0f} m tall"
    yield Line(f"Surfaces of a tree of {whole}", ())
    tubes = f"tubes, {skin['tube_triangles']:,} triangles, s"
    yield Line(tubes, (f"{skin['tubes_s']:.2f}", f"{skin['tubes_cpu_s']:.2f}"))
    whole = f"blended, cells of 1 cm, {skin['blended_triangles']:,} triangles, s"
    yield Line(whole, (f"{skin['blended_s']:.1f}", f"{skin['blended_cpu_s']:.1f}"))
    yield Line("most memory held, GiB", (f"{skin['blended_gib']:.1f}",))
    yield from _bark_lines(result["bark"])
    yield from _flow_lines(result["flow"])
    maps = result["bark_maps"]
    yield Line(f"Maps of a trunk, {maps['size']} x {maps['size']}", ())
    for key, what in (("maps", "4K set: textures, maps, s"), ("save", "4K set: its PNGs, s")):
        yield Line(what, (f"{maps[key + '_s']:.1f}", f"{maps[key + '_cpu_s']:.1f}"))
    yield from _viewer_lines(result["viewer"])
    starts = result["starts"]
    yield Line("Start", ())
    cold = (f"{starts['cold_s']:.1f}", f"{starts['cold_cpu_s']:.1f}")
    yield Line("cold, to the end of the first year, s", cold)
    yield Line("warm, to the end of the first year, s", (f"{starts['warm_s']:.2f}",))
    yield Line("forest --help, s", (f"{starts['help_s']:.2f}",))


def _frame_lines(frames: dict[str, Any]) -> Iterator[Line]:
    one, most = (frames["threads"][key(frames["threads"])] for key in (min, max))
    seen = f"{frames['seen']:,} seen, {frames['primitives'] / 1e6:.1f} million primitives"
    yield Line(f"A view of {frames['trees']:,} aspens of 8 models: {seen}", ())
    for key, busy, what in (
        ("plain_s", "", "the frame without shade, s"),
        ("shaded_s", "shaded_cpu_s", "the frame, s"),
        ("million_s", "million_cpu_s", "the frame, s per million primitives"),
    ):
        cpu = f"{most[busy]:.3g}" if busy else ""
        cells = (f"{most[key]:.3g}", cpu, f"{one[key]:.3g}", f"{one[key] / most[key]:.2f}")
        yield Line(what, cells)
    for key, what in (
        ("lists_s", "once: the models' lists, s"),
        ("own_shadows_s", "once a sun: the models' own shadows, s"),
        ("scene_shadow_s", "once a sun: the scene's shadow map, s"),
    ):
        yield Line(what, (f"{frames[key]:.2f}",))


def _flow_lines(found: dict[str, Any]) -> Iterator[Line]:
    yield Line("Bark flow", ())
    for key, what in (
        ("chain", f"a chain past a branching, {found['particle_steps']:,} steps of particles, s"),
        ("maple", f"maple bark on a metre of trunk, {found['triangles']:,} triangles, s"),
        ("wound", f"ten years of a wound under {found['covering']:,} particles, s"),
    ):
        yield Line(what, tuple(f"{seconds:.2f}" for seconds in found[key]))
    parted = f"{found['crown_parted']} of {found['crown_limbs'] - 1} limbs parted"
    crown = f"an aspen's crown, {found['crown_steps']:,} steps of particles, {parted}, s"
    yield Line(crown, tuple(f"{seconds:.2f}" for seconds in found["crown"]))
    per_step = tuple(f"{1e6 * seconds / found['crown_steps']:.2f}" for seconds in found["crown"])
    yield Line("the same, µs per step of a particle", per_step)


def _bark_lines(cases: dict[str, Any]) -> Iterator[Line]:
    yield Line("Fracture bark, 40 steps", ())
    for name, case in cases.items():
        if name != "paper_s":
            what = f"{name}, {case['elements']:,} elements, s"
            yield Line(what, (f"{case['wall_s']:.2f}", f"{case['cpu_s']:.2f}"))


def _viewer_lines(viewer: dict[str, Any]) -> Iterator[Line]:
    yield Line(f"The viewer with a stand of {viewer['trees']:,} trees", ())
    for key, what in (
        ("open", "opening: the app and its first picture, s"),
        ("year", "another year and its picture, s"),
        ("frame", "a picture while the view turns, JPEG included, s"),
    ):
        yield Line(what, (f"{viewer[key + '_s']:.3g}", f"{viewer[key + '_cpu_s']:.3g}"))
    yield Line("pictures per second", (f"{1.0 / viewer['frame_s']:.0f}",))
    if viewer["browser_fps"] == viewer["browser_fps"]:  # NaN without a browser
        yield Line("the same that reach a browser", (f"{viewer['browser_fps']:.0f}",))
    yield Line("peak memory, GB", (f"{viewer['peak_mb'] / 1024.0:.2f}",))


def _scene_lines(scene: dict[str, Any]) -> Iterator[Line]:
    what = f"{scene['trees']:,} trees of {scene['shapes']} shapes on {scene['hectares']:.2f} ha"
    yield Line(f"A scene at stand detail: {what}, a .glb of {scene['megabytes']:.0f} MB", ())
    yield Line("meshes and file, s", (f"{scene['seconds']:.3g}", f"{scene['cpu_s']:.3g}"))
    yield Line("peak memory, GB", (f"{scene['peak_gb']:.2f}",))


def show(result: dict[str, Any]) -> None:
    """Print the table."""
    machine = result["machine"]
    table = Table(
        title=f"{machine['processor']}, {machine['cores']} cores, "
        f"{machine['memory_gb']:.0f} GB; "
        f"other programs took {result['others_share']:.0%} of the time",
    )
    table.add_column("")
    for heading in HEADINGS:
        table.add_column(heading, justify="right")
    for line in lines(result):
        if line.cells:
            table.add_row(f"  {line.what}", *line.cells)
        else:
            table.add_section()
            table.add_row(f"[bold]{line.what}[/bold]")
    console = Console()
    if not console.is_terminal:
        console.width = 160
    console.print(table)


def to_markdown(result: dict[str, Any]) -> str:
    """Give the machine and the table as Markdown."""
    machine = result["machine"]
    text = [
        f"{machine['processor']}, {machine['cores']} cores, {machine['memory_gb']:.0f} GB; "
        f"{machine['system']}; Python {machine['python']}, NumPy {machine['numpy']}, "
        f"numba {machine['numba']}, forest {machine['forest']}; measured {result['finished']}, "
        f"while other programs took {result['others_share']:.0%} of the processors' time.",
        "",
        "| | " + " | ".join(HEADINGS) + " |",
        "|---|" + "---:|" * len(HEADINGS),
    ]
    for line in lines(result):
        if line.cells:
            cells = [*line.cells, *[""] * (len(HEADINGS) - len(line.cells))]
            text.append(f"| {line.what} | " + " | ".join(cells) + " |")
        else:
            text.append(f"| **{line.what}** |" + " |" * len(HEADINGS))
    return "\n".join(text)


if __name__ == "__main__":
    print(to_markdown(json.loads(Path(sys.argv[1]).read_text())))
