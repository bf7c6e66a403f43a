"""The branch of a preloaded cam: the monotone piece of the stiffness that extends to the largest pretension.

`map_branch` maps it over the torque once per cam: the kind of its inner end, and first guesses of both ends.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from vsacli.actuators.mechanisms.preloaded_cams.lift import Lift, LinearInTorque
from vsacli.actuators.pairs.bracketing import bracketed_root
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.compute.control_flow import look_up

PRETENSION, FOLD, PEAK, DOMAIN = range(4)
"""Kinds of ends of the branch."""


class TorqueCells(NamedTuple):
    """Both ends of the branch over the cube root of the torque, by cubics; arrays (cells,).

    The cubics approximate the ratio of deflection from rest to that root, which is smooth even for a cam
    without pretension, whose torque is the third power of the deflection.

    Attributes:
        root: Cube root of the torque at which a cell begins.
        outer: End at the largest pretension: coefficients over the distance from `root`, (4, cells).
        inner: Other end of the branch, as above.
        end: Kind of the inner end.
        sign: 1 where the stiffness falls with the pretension along the branch, -1 where it rises.
    """

    root: FloatArray
    outer: FloatArray
    inner: FloatArray
    end: FloatArray
    sign: FloatArray


class ApproximateEnds(NamedTuple):
    """Deflections from rest between which the branch lies, see `TorqueCells`; arrays (samples,)."""

    outer: FloatArray
    inner: FloatArray
    end: FloatArray
    sign: FloatArray


class CamBranch(NamedTuple):
    """The branch at every torque.

    Attributes:
        cells: Cells of the torque.
        torque_range: Torques that can be carried.
    """

    cells: TorqueCells
    torque_range: tuple[float, float]

    def ends(self, tau_e: FloatArray) -> ApproximateEnds:
        """Return both ends of the branch, to a relative error of about 1e-5."""
        root = np.cbrt(tau_e)
        cell = np.searchsorted(self.cells.root[1:], root, side="right")
        start, end, sign, *cubics = look_up(
            (self.cells.root, self.cells.end, self.cells.sign, *self.cells.outer, *self.cells.inner), cell
        )
        x = root - start
        outer, inner = (a + x * (b + x * (c + x * d)) for a, b, c, d in (cubics[:4], cubics[4:]))
        return ApproximateEnds(root * outer, root * inner, end, sign)


SAMPLED_SHARES = np.concatenate((np.geomspace(1e-9, 0.01, 150, endpoint=False), np.linspace(0.01, 1, 800)))
"""Shares of the domain at which curves are sampled; a fitted profile has some dozen features."""

FIRST_CELLS = 32
"""Number of cells of the torque on either side of rest at first."""

GUESS_RTOL = 1e-5
"""Largest relative error of a deflection in a cell, which two Newton steps reduce to rounding."""

MAX_HALVINGS = 36
"""Largest number of halvings, at torques where the branch has another kind of end, or a curve turns."""

MAX_SLOPE_SUM = 10.0
"""Sum of the slopes at both ends of a cell, over its height and width, beyond which no cubic is close."""

REST_SHARE = 1e-4
"""Share of the largest cube root of the torque at which the limit at rest is taken."""

LiftOf = Callable[[FloatArray], Lift]


def map_branch(
    lift: LiftOf, domain: tuple[float, float], k: float, pretension: tuple[float, float]
) -> CamBranch:
    """Return the branch of a cam.

    Args:
        lift: Over deflections from rest, which is the minimum.
        domain: Least and largest deflection from rest.
        k: Stiffness of the spring, N/m.
        pretension: Smallest and largest, m.
    """
    sides = (
        _CamSide(lift, domain[1], k, pretension),
        _CamSide(lambda phi: lift(-phi).mirrored(), -domain[0], k, pretension),
    )
    symmetric = domain[0] == -domain[1] and all(map(np.array_equal, *(side.lift_at_nodes for side in sides)))
    nodes_above = sides[0].nodes()
    nodes_below = nodes_above if symmetric else sides[1].nodes()
    cells_of_sides = nodes_below.mirrored().cells(), nodes_above.cells()
    cells = TorqueCells(*(np.concatenate(columns, axis=-1) for columns in zip(*cells_of_sides, strict=True)))
    return CamBranch(cells, (-sides[1].largest_torque, sides[0].largest_torque))


class _Nodes(NamedTuple):
    """Ends of the branch at ascending torques, as in `TorqueCells`, with slopes; arrays (nodes,)."""

    root: FloatArray
    outer: FloatArray
    outer_slope: FloatArray
    inner: FloatArray
    inner_slope: FloatArray
    end: FloatArray
    sign: FloatArray

    def mirrored(self) -> _Nodes:
        """Return the nodes of the mirrored cam."""
        reversed_nodes = self.take(slice(None, None, -1))
        return reversed_nodes._replace(
            root=-reversed_nodes.root,
            outer_slope=-reversed_nodes.outer_slope,
            inner_slope=-reversed_nodes.inner_slope,
        )

    def take(self, nodes: IndexArray | slice) -> _Nodes:
        """Return a selection of the nodes."""
        return _Nodes(*(values[nodes] for values in self))

    def merged(self, added: _Nodes) -> _Nodes:
        """Return these nodes and others, sorted."""
        nodes = _Nodes(*map(np.concatenate, zip(self, added, strict=True)))
        return nodes.take(np.argsort(nodes.root))

    def misses(self, middle: _Nodes) -> BoolArray:
        """Return where the kind of end changes within a cell, or a cubic is inaccurate in its middle."""
        is_inaccurate: BoolArray = (np.diff(self.end) != 0) | (np.diff(self.sign) != 0)
        width = np.diff(self.root)
        for values, slope, expected in (
            (self.outer, self.outer_slope, middle.outer),
            (self.inner, self.inner_slope, middle.inner),
        ):
            a, b, c, d = _cubic_coefficients(width, values, slope)
            interpolated = a + width / 2 * (b + width / 2 * (c + width / 2 * d))
            is_inaccurate |= ~(np.abs(interpolated - expected) <= GUESS_RTOL * np.abs(expected))
        return is_inaccurate

    def cells(self) -> TorqueCells:
        """Return cubics between the nodes; each cell has the kind of end of its node nearer to rest."""
        width = np.diff(self.root)
        outer = _cubic_coefficients(width, self.outer, self.outer_slope)
        inner = _cubic_coefficients(width, self.inner, self.inner_slope)
        node_nearer_rest = slice(1, None) if self.root[0] < 0 else slice(None, -1)
        return TorqueCells(
            self.root[:-1], outer, inner, self.end[node_nearer_rest], self.sign[node_nearer_rest]
        )


def _cubic_coefficients(width: FloatArray, values: FloatArray, slopes: FloatArray) -> FloatArray:
    """Return coefficients of cubics with values and slopes, or of lines where too steep; (4, cells)."""
    chord, first, last = np.diff(values) / width, slopes[:-1], slopes[1:]
    is_usable = np.abs(first) + np.abs(last) <= MAX_SLOPE_SUM * np.abs(values).max() / width
    first, last = np.where(is_usable, first, chord), np.where(is_usable, last, chord)
    quadratic, cubic = (3 * chord - 2 * first - last) / width, (first + last - 2 * chord) / width**2
    return np.stack((values[:-1], first, quadratic, cubic))


class _ZeroCurve:
    """A curve on which a function of deflection and torque is zero."""

    def __init__(self, lift: LiftOf, function: Callable[[Lift], LinearInTorque]) -> None:
        self._lift, self._function = lift, function

    def __call__(self, phi: FloatArray) -> LinearInTorque:
        return self._function(self._lift(phi))

    def root(self, low: FloatArray, high: FloatArray, tau_e: FloatArray) -> FloatArray:
        """Return the deflection on the curve between `low` and `high`."""
        return bracketed_root(lambda phi, tau_e: self(phi).at(tau_e), low, high, (tau_e,))

    def slope(self, phi: FloatArray, tau_e: FloatArray) -> FloatArray:
        """Return the derivative of the deflection over the torque along the curve; infinite at its turns."""
        function = self(phi)
        with np.errstate(all="ignore"):
            return -function.b / function.slope(tau_e)

    def turns(self, phi: FloatArray) -> FloatArray:
        """Return deflections strictly between nodes at which the torque has an extremum along the curve."""

        def torque_slope(phi: FloatArray) -> FloatArray:
            function = self(phi)
            return function.a_slope * function.b - function.a * function.b_slope

        sign = np.sign(torque_slope(phi))
        sign_changes = np.flatnonzero(sign[:-1] * sign[1:] < 0)
        return bracketed_root(torque_slope, phi[sign_changes], phi[sign_changes + 1])


class _CamSide:
    """The cam on one side of rest: positive torques at positive deflections."""

    def __init__(self, lift: LiftOf, end: float, k: float, pretension: tuple[float, float]) -> None:
        low, high = pretension
        self._outer_curve = _ZeroCurve(lift, lambda lift: lift.torque_error(k, high))
        self._fold_curve = _ZeroCurve(lift, lambda lift: lift.fold_condition(k))
        self._ends = {
            PRETENSION: _ZeroCurve(lift, lambda lift: lift.torque_error(k, low)),
            FOLD: self._fold_curve,
            PEAK: _ZeroCurve(lift, lambda lift: lift.torque_peak_condition(k)),
        }
        phi = end * SAMPLED_SHARES
        self.lift_at_nodes = lift(phi)
        turns = [curve.turns(phi) for curve in (self._outer_curve, *self._ends.values())]
        self._phi = np.unique(np.concatenate((phi, *turns)))
        self._conditions_at_nodes = {end: curve(self._phi) for end, curve in self._ends.items()}
        outer_function = self._outer_curve(self._phi)
        falling_indices = np.flatnonzero(outer_function.a_slope <= 0)
        count = falling_indices[0] + 1 if falling_indices.size else self._phi.size
        self._outer_phi = np.append(0.0, self._phi[:count])
        self._outer_torque = np.maximum.accumulate(np.append(0.0, outer_function.a[:count]))
        self.largest_torque = float(self._outer_torque[-1])

    def nodes(self) -> _Nodes:
        """Return nodes dense enough that cubics between them are good first guesses."""
        largest = np.cbrt(self.largest_torque)
        at_rest = self._rest_node(self._nodes_at(np.array([REST_SHARE * largest])))
        nodes = at_rest.merged(self._nodes_at(np.linspace(0, largest, FIRST_CELLS + 1)[1:]))
        for _ in range(MAX_HALVINGS):
            middle = self._nodes_at((nodes.root[:-1] + nodes.root[1:]) / 2)
            inaccurate = np.flatnonzero(nodes.misses(middle))
            if not inaccurate.size:
                break
            nodes = nodes.merged(middle.take(inaccurate))
        return nodes

    def _rest_node(self, node: _Nodes) -> _Nodes:
        """Return the node without torque, from one next to it.

        There the deflection is proportional to the torque; only that of a fold, to its cube root.
        """
        is_fold, zero = node.end == FOLD, np.zeros(1)
        inner, slope = (np.where(is_fold, values, 0.0) for values in (node.inner, node.inner_slope))
        return node._replace(root=zero, outer=zero, outer_slope=zero, inner=inner, inner_slope=slope)

    def _nodes_at(self, root: FloatArray) -> _Nodes:
        """Return both ends of the branch at torques with these cube roots."""
        tau_e = np.minimum(root**3, self.largest_torque)
        node = np.clip(np.searchsorted(self._outer_torque, tau_e), 1, self._outer_phi.size - 1)
        outer = self._outer_curve.root(self._outer_phi[node - 1], self._outer_phi[node], tau_e)
        inner, end = self._inner_ends(tau_e, outer)
        slope = np.zeros_like(inner)
        for kind, curve in self._ends.items():
            slope = np.where(end == kind, curve.slope(inner, tau_e), slope)
        sign = np.where(self._fold_curve(outer).at(tau_e) < 0, -1.0, 1.0)
        return _Nodes(
            root,
            *_divided_by_root(root, outer, self._outer_curve.slope(outer, tau_e)),
            *_divided_by_root(root, inner, slope),
            end.astype(float),
            sign,
        )

    def _inner_ends(self, tau_e: FloatArray, outer: FloatArray) -> tuple[FloatArray, IndexArray]:
        """Return the first end of the branch at deflections above the outer one, and its kind."""
        inner, end = np.full_like(outer, self._phi[-1]), np.full(outer.shape, DOMAIN)
        is_beyond = self._phi > outer[:, None]
        for kind, curve in self._ends.items():
            values = self._conditions_at_nodes[kind]
            positive = values.a + values.b * tau_e[:, None] > 0
            is_changed = is_beyond & (positive != (curve(outer).at(tau_e) > 0)[:, None])
            crossed_rows = np.flatnonzero(is_changed.any(axis=1))
            node = np.argmax(is_changed[crossed_rows], axis=1)
            left_node = np.maximum(self._phi[np.maximum(node - 1, 0)], outer[crossed_rows])
            crossing = curve.root(left_node, self._phi[node], tau_e[crossed_rows])
            is_nearer = crossing < inner[crossed_rows]
            inner[crossed_rows[is_nearer]], end[crossed_rows[is_nearer]] = crossing[is_nearer], kind
        return inner, end


def _divided_by_root(root: FloatArray, phi: FloatArray, slope: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return phi over the cube root of the torque, and its derivative over that root, from d phi/d torque."""
    ratio = phi / root
    return ratio, (3 * root * root * slope - ratio) / root
