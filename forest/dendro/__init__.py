"""Tree rings: dated series, increment cores, discs and sections, files, and cross-dating."""

from __future__ import annotations

from forest.dendro.ages import ages
from forest.dendro.campaign import campaign
from forest.dendro.cores import Core, bore, core, radial_widths
from forest.dendro.crossdating import interseries_correlation
from forest.dendro.disc import Disc
from forest.dendro.knots import Knot
from forest.dendro.life import StemLife
from forest.dendro.names import short_ids
from forest.dendro.section import Section
from forest.dendro.series import RingSeries, ring_series
from forest.dendro.tucson import read_rwl, write_rwl
from forest.dendro.wide_csv import read_csv, write_csv

__all__ = [
    "Core",
    "Disc",
    "Knot",
    "RingSeries",
    "Section",
    "StemLife",
    "ages",
    "bore",
    "campaign",
    "core",
    "interseries_correlation",
    "radial_widths",
    "read_csv",
    "read_rwl",
    "ring_series",
    "short_ids",
    "write_csv",
    "write_rwl",
]
