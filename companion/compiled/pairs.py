"""The inner loops of the joint table: how near paths of two members come, and rows improved in turn.

Compiled, or run as plain Python with the same bits, like `kernels.py`, whose rules hold here too.
"""

from __future__ import annotations

import numpy as np

try:
    import cython as c
except ImportError:
    from companion.compiled import no_cython as c

if c.compiled:
    from cython.cimports.libc.math import sqrt
else:
    from math import sqrt


@c.cfunc
@c.inline
def _lists(array):
    """The array itself where compiled, otherwise nested lists of its numbers."""
    return array if c.compiled else array.tolist()


def pair_distances(one_m, other_m, times_s, reach_m: c.double):
    """The mean distance over time, capped at the reach, and the smallest, of all pairs of rows, (R, S) each.

    Paths are (R, T, 3) and (S, T, 3), straight between the times (T,); so the smallest distance may be
    between two of them.
    """
    rows: c.Py_ssize_t = len(one_m)
    others: c.Py_ssize_t = len(other_m)
    count: c.Py_ssize_t = len(times_s)
    if count < 2 or one_m.shape[1:] != (count, 3) or other_m.shape[1:] != (count, 3):
        raise ValueError("arrays of lengths that do not match")
    one: c.const[c.double][:, :, ::1] = _lists(one_m)
    other: c.const[c.double][:, :, ::1] = _lists(other_m)
    times: c.const[c.double][::1] = _lists(times_s)
    means, leasts = np.empty((rows, others)), np.empty((rows, others))
    mean: c.double[:, ::1] = means
    least: c.double[:, ::1] = leasts
    i: c.Py_ssize_t
    j: c.Py_ssize_t
    k: c.Py_ssize_t
    for i in range(rows):
        for j in range(others):
            north = other[j][0][0] - one[i][0][0]
            east = other[j][0][1] - one[i][0][1]
            down = other[j][0][2] - one[i][0][2]
            off2 = north * north + east * east + down * down
            least2, whole = off2, 0.0
            for k in range(1, count):
                next_north = other[j][k][0] - one[i][k][0]
                next_east = other[j][k][1] - one[i][k][1]
                next_down = other[j][k][2] - one[i][k][2]
                next2 = next_north * next_north + next_east * next_east + next_down * next_down
                step_n, step_e, step_d = next_north - north, next_east - east, next_down - down
                along = north * step_n + east * step_e + down * step_d
                length2 = step_n * step_n + step_e * step_e + step_d * step_d
                if next2 < least2:
                    least2 = next2
                # Closest within the step: where it is neither at its begin nor at its end.
                if along < 0.0 and length2 > -along:
                    within2 = off2 - along * along / length2
                    if within2 < least2:
                        least2 = within2
                whole += min(sqrt(next2), reach_m) * (times[k] - times[k - 1])
                north, east, down, off2 = next_north, next_east, next_down, next2
            mean[i, j] = whole / times[count - 1]
            least[i, j] = sqrt(max(least2, 0.0))
    return means, leasts


def improve(alone_, value_, least_, separation_m: c.double, rows, rounds: c.Py_ssize_t):
    """Members in turn take their best row, in their order, until none changes; the rows then, a list (N,).

    `alone` (N, R) is the value of a row, `value` (N, N, R, R) that of two, and `least` (N, N, R, R) their
    smallest distance. A row that keeps the separation from the rows of all others goes before one that does
    not; among the others the one with the largest distance is the best.
    """
    count: c.Py_ssize_t = len(alone_)
    width: c.Py_ssize_t = alone_.shape[1]
    if value_.shape != (count, count, width, width) or least_.shape != value_.shape or len(rows) != count:
        raise ValueError("arrays of lengths that do not match")
    alone: c.const[c.double][:, ::1] = _lists(alone_)
    value: c.const[c.double][:, :, :, ::1] = _lists(value_)
    least: c.const[c.double][:, :, :, ::1] = _lists(least_)
    chosen_ = np.array(rows, dtype=np.int64)
    chosen: c.longlong[::1] = chosen_
    i: c.Py_ssize_t
    j: c.Py_ssize_t
    row: c.Py_ssize_t
    for _ in range(rounds):
        changed: c.bint = False
        for i in range(count):
            best: c.Py_ssize_t = 0
            best_kept: c.bint = False
            best_score = -1.0
            for row in range(width):
                total, nearest = alone[i][row], float("inf")
                for j in range(count):
                    if j != i:
                        total += value[i][j][row][chosen[j]]
                        nearest = min(nearest, least[i][j][row][chosen[j]])
                kept: c.bint = nearest >= separation_m
                score = total if kept else nearest
                if row == 0 or (kept and not best_kept) or (kept == best_kept and score > best_score):
                    best, best_kept, best_score = row, kept, score
            if best != chosen[i]:
                chosen[i] = best
                changed = True
        if not changed:
            break
    return chosen_.tolist()
