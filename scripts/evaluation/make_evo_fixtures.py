#!/usr/bin/env python3
"""Writes test/data/evo: small random trajectories and what evo says about them.

The tests of libs/evaluation must agree with these numbers to 1e-6. To make them again (made with evo 1.38.1, numpy 2.4.6,
Python 3.11; results.json says the versions of the last run):

    python3 -m venv build/evo && build/evo/bin/pip install evo==1.38.1
    build/evo/bin/python scripts/evaluation/make_evo_fixtures.py test/data/evo
"""

import copy
import json
import pathlib
import sys

import evo
import numpy as np
from evo.core import metrics, sync
from evo.main_ape import ape
from evo.main_rpe import rpe
from evo.tools import file_interface
from scipy.spatial.transform import Rotation

RELATIONS = {"translation_m": metrics.PoseRelation.translation_part, "rotation_deg": metrics.PoseRelation.rotation_angle_deg}
ALIGNMENTS = {"none": (False, False), "se3": (True, False), "sim3": (True, True)}
PIECES = [(1, "frames", False), (4, "frames", False), (3, "frames", True), (0.8, "metres", False), (0.8, "metres", True)]
UNITS = {"frames": metrics.Unit.frames, "metres": metrics.Unit.meters}


def random_walk(random, count, planar):
    """Positions and orientations of a body that strolls about, one pose each 0.2 s."""
    turn = Rotation.identity()
    position = np.zeros(3)
    positions, turns = [], []
    for _ in range(count):
        positions.append(position.copy())
        turns.append(turn)
        axis = np.array([0.0, 0.0, 1.0]) if planar else random.normal(size=3)
        turn = turn * Rotation.from_rotvec(0.25 * random.normal() * axis)
        position = position + turn.apply([0.15 + 0.1 * random.random(), 0.0, 0.0])
    return np.array(positions), turns


def disturbed(random, positions, turns, planar, scale, distance, angle):
    """The same trajectory seen from another frame, at another scale, with noise."""
    away = Rotation.from_rotvec([0.0, 0.0, 0.9] if planar else [0.3, -0.5, 0.9])
    noise = random.normal(size=positions.shape) * distance
    if planar:
        noise[:, 2] = 0.0
    seen = scale * away.apply(positions + noise) + [1.5, -2.0, 0.0 if planar else 0.7]
    seen_turns = []
    for turn in turns:
        axis = np.array([0.0, 0.0, 1.0]) if planar else random.normal(size=3)
        seen_turns.append(away * turn * Rotation.from_rotvec(angle * random.normal() * axis))
    return seen, seen_turns


def write_tum(path, stamps, positions, turns):
    with open(path, "w") as file:
        file.write("# stamp x y z qx qy qz qw\n")
        for stamp, position, turn in zip(stamps, positions, turns):
            file.write(f"{stamp:.6f} " + " ".join(f"{value:.6f}" for value in [*position, *turn.as_quat()]) + "\n")


def results_of(reference_path, estimate_path, max_difference):
    reference = file_interface.read_tum_trajectory_file(str(reference_path))
    estimate = file_interface.read_tum_trajectory_file(str(estimate_path))
    reference, estimate = sync.associate_trajectories(reference, estimate, max_diff=max_difference)
    results = []
    for align, (rigid, scale) in ALIGNMENTS.items():
        absolute = {name: ape(copy.deepcopy(reference), copy.deepcopy(estimate), relation, align=rigid, correct_scale=scale)
                    for name, relation in RELATIONS.items()}
        results.append({"kind": "absolute", "align": align, **{name: result.stats for name, result in absolute.items()}})
        transform = absolute["translation_m"].np_arrays.get("alignment_transformation_sim3")
        if transform is not None:
            results[-1]["reference_from_estimate"] = transform.tolist()
        for delta, unit, all_pairs in PIECES:
            results.append({"kind": "relative", "align": align, "delta": delta, "unit": unit, "all_pairs": all_pairs,
                            **{name: rpe(copy.deepcopy(reference), copy.deepcopy(estimate), relation, delta=delta,
                                         delta_unit=UNITS[unit], all_pairs=all_pairs, align=rigid, correct_scale=scale).stats
                               for name, relation in RELATIONS.items()}})
    return {"pairs": reference.num_poses, "max_stamp_difference_s": max_difference, "results": results}


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(7)
    cases = {}
    for name, planar, scale in [("planar", True, 1.0), ("handheld", False, 0.7)]:
        positions, turns = random_walk(random, 80, planar)
        stamps = 1305031102.175304 + 0.2 * np.arange(80)
        seen, seen_turns = disturbed(random, positions, turns, planar, scale, 0.04, 0.03)
        write_tum(folder / f"{name}_reference.tum", stamps, positions, turns)
        # The estimate has every pose of the planar robot; two of three of the handheld one, at times of its own.
        kept = [i for i in range(80) if planar or i % 3 != 1]
        own = stamps if planar else stamps + random.uniform(-0.02, 0.02, 80)
        write_tum(folder / f"{name}_estimate.tum", own[kept], seen[kept], [seen_turns[i] for i in kept])
        cases[name] = results_of(folder / f"{name}_reference.tum", folder / f"{name}_estimate.tum", 0.01)
    with open(folder / "results.json", "w") as file:
        json.dump({"versions": {"evo": evo.__version__, "numpy": np.__version__}, "cases": cases}, file, indent=1)
        file.write("\n")


if __name__ == "__main__":
    main()
