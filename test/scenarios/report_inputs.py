"""Folders of results that no run is needed for: a large team, and names that try to break out of the page."""
import json
import math

MAP_YAML = "image: map.pgm\nmode: trinary\nresolution: 0.05\norigin: [{}, {}, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"


def write_floor(folder, cells, x_m=0.0, y_m=0.0):
    """A square grid of rooms of 5 m, with doors."""
    room, wall, free = 100, b"\x00", b"\xfe"
    inner = (wall * 2 + free * (room - 2)) * (cells // room)
    door = (wall * 2 + free * (room - 2)) * (cells // room)
    door = door.replace(wall, free) if cells < 200 else free * cells
    solid = (wall * (room - 20) + free * 20) * (cells // room)
    rows = [solid if row % room < 2 else door if row % room > room - 20 else inner for row in range(cells)]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "map.pgm").write_bytes(b"P5\n%d %d\n255\n" % (cells, cells) + b"".join(rows))
    (folder / "map.yaml").write_text(MAP_YAML.format(x_m, y_m))


def tum_text(poses, x_m, y_m, length_m, begin_s):
    lines = []
    for i in range(poses):
        angle = 2 * math.pi * i / poses
        x, y, yaw = x_m + length_m * math.cos(angle), y_m + length_m * math.sin(2 * angle) / 2, angle + math.pi / 2
        lines.append(f"{begin_s + 0.2 * i:.6f} {x:.6f} {y:.6f} 0 0 0 {math.sin(yaw / 2):.6f} {math.cos(yaw / 2):.6f}")
    return "\n".join(lines) + "\n"


def verdict(a, b, accepted, conflicts=()):
    decision = "accepted" if accepted else "refused"
    hypothesis = {"sense": "lasers", "b_from_a": {"x": 1.5, "y": -2.25, "yaw": 0.5}, "probability": 0.97, "matches": 7, "coinciding_m": 123.4, "distinctive_m": 55.5,
                  "contradicted_m": 1.2, "unclear_m": 4.5, "by_chance_m": 5.0, "support_m": 0.0, "overlap": 0.41, "elsewhere": 0, "taken_apart": False, "contradictions": []}
    return {"tier": "cloud", "words": f"{a} + {b}: {'merged' if accepted else 'kept apart: one saw through walls of the other'}", "a": a, "b": b, "accepted": accepted,
            "decision": decision, "reason": "none" if accepted else "contradiction", "because": "no doubt" if accepted else "one saw through walls of the other", "detail": "",
            "in_one_map": accepted, "connected_through": [], "team_b_from_a": None, "b_from_a": {"x": 1.5, "y": -2.25, "yaw": 0.5} if accepted else None,
            "audit": {"taken_apart": False, "conflicts": list(conflicts)}, "hypotheses": [hypothesis] * 3, "prior": None, "probability": 0.97, "overlap": 0.41}


def write_results(folder, robots, cells, poses, verb="run"):
    """As `run` leaves it: a team map of `cells` by `cells`, a map of each robot, every pair."""
    side = cells * 0.05
    write_floor(folder / "team", cells)
    (folder / "team/trajectories").mkdir()
    for index, name in enumerate(robots):
        x, y = side * (0.15 + 0.7 * (index % 7) / 7), side * (0.15 + 0.7 * (index // 7) / 7)
        (folder / f"team/trajectories/{name}.tum").write_text(tum_text(poses, x, y, side / 10, 1000.0 + 3 * index))
        write_floor(folder / "robots" / name, min(cells, 800))
        (folder / f"robots/{name}/trajectory.tum").write_text(tum_text(poses, 20, 20, 10, 1000.0 + 3 * index))
    summary = {"robots": [{"id": name, "scans": poses, "log_seconds": poses / 5, "wall_seconds": 3.5, "cpu_seconds": 3.1, "mapped": True, "edge": f"edge{i % 4}"}
                          for i, name in enumerate(robots)],
               "edges": [], "team": {"components": 1, "members": [list(robots)]}, "notes": [], "interrupted": False, "exit_code": 0, "wall_seconds": 99.5,
               "peak_rss_bytes": 1234567890, "stages": [{"tier": "cloud", "name": "pairwise matching", "seconds": 12.5}]}
    pairs = [verdict(a, b, (i + j) % 3 != 0, [{"x_m": 5, "y_m": 5, "length_m": 2}] if i + j == 1 else [])
             for i, a in enumerate(robots) for j, b in enumerate(robots) if i < j]
    (folder / "summary.json").write_text(json.dumps(summary))
    (folder / "merges.json").write_text(json.dumps(pairs))
    (folder / "manifest.json").write_text(json.dumps({"program": "mapweave", "verb": verb, "versions": {"mapweave": "0.1.0"}, "seed": 1,
                                                      "inputs": [{"path": f"logs/{name}.rawlog", "sha256": "0" * 64} for name in robots], "outputs": {}}))
    (folder / "config.yaml").write_text("seed: 1\n")
