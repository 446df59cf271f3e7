# SPDX-License-Identifier: GPL-3.0-or-later
"""The report of a finished frame."""

from __future__ import annotations

from dataclasses import dataclass

# The surfaces shaded a projector beyond which Cycles takes less time for the same samples, by scenes of
# ``benchmarks/real``: the street has fewer, all others more.
SLOW_PATHS = 1.3


@dataclass(frozen=True)
class RenderReport:
    """The figures of a frame.

    seconds: in all. build_seconds: the part that prepared the scene. straight: whether a projector is one
    straight line. projectors: number cast, one a sample where the image shows anything. chords: their
    straight pieces within the scene. rays: all traced for them, without shadow rays. hit_fraction: share of
    the projectors that hit, in [0, 1]. error_bound: largest distance between a projector and its chords,
    pixels. folded_share: share of the volume shown that is turned inside out, with a mirrored image
    (``projection.volume.folds``). mirrored: whether the image of the rest is mirrored. exact: whether hits
    are those of the curves themselves. tests: intersections of curves and triangles for that. triangles: of
    the scene. built: those that the volume can meet. peak_memory: the most bytes that the whole process has
    held so far; 0 if unknown. shaded: surfaces that paths meet, twice those whose nodes are evaluated there,
    per projector that hits; 0 where paths end at once.
    """

    width: int
    height: int
    seconds: float
    build_seconds: float
    straight: bool
    projectors: int
    rays: int
    chords: int
    hit_fraction: float
    error_bound: float
    folded_share: float
    mirrored: bool = False
    exact: bool = False
    tests: int = 0
    triangles: int = 0
    built: int = 0
    peak_memory: int = 0
    shaded: float = 0.0

    @property
    def chords_per_projector(self) -> float:
        """Mean number of chords in a projector, 0 when nothing was cast."""
        return self.chords / self.projectors if self.projectors else 0.0

    @property
    def folded(self) -> bool:
        """Return whether the volume folds."""
        return self.folded_share > 0.0

    def outcome(self) -> str:
        """Size and time of the image, and warnings, separated by " · "."""
        parts = [f"{self.width}×{self.height} in {self.seconds:.2f} s"]
        if not self.projectors:
            parts.append("nothing to cast at")
        if self.mirrored:
            parts.append("mirrored")
        if self.folded:
            parts.append(f"{max(self.folded_share, 0.01):.0%} of the volume folds")
        return " · ".join(parts)

    def statistics(self) -> str:
        """Rays, chords, error, triangles and memory, separated by " · "; empty if none is known."""
        parts = []
        if self.projectors:
            parts.append(f"{_short(self.rays)} rays")
            if self.straight:
                parts.append("straight projectors")
            else:
                parts.append(f"{self.chords_per_projector:.1f} chords a projector")
            if self.exact:
                parts.append(f"exact, {_short(self.tests)} tests")
            elif not self.straight:
                parts.append(f"error ≤ {self.error_bound:.2g} px")
        if self.built < self.triangles:
            parts.append(f"{_short(self.built)} of {_short(self.triangles)} triangles in reach")
        if self.peak_memory:
            parts.append(f"memory up to {_short(self.peak_memory)}B")
        if self.shaded > SLOW_PATHS:
            parts.append("Cycles is faster at these samples")
        return " · ".join(parts)

    def summary(self) -> str:
        """Outcome and statistics in one line."""
        return " · ".join(filter(None, (self.outcome(), self.statistics())))


def _short(count: int) -> str:
    """Abbreviate a number: 1234567 is 1.2 M."""
    for size, unit in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if count >= size:
            return f"{count / size:.1f} {unit}"
    return str(count)
