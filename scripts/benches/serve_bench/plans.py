"""A coordinator while robots drive: one edge becomes slow, the other one is killed."""
import json
import signal
import threading
import time

from benches.serve_bench.team import Team, different, load_average, missing_scans, outputs

# So fast that an edge that works for a fiftieth of the time has no time left: what it takes for a scan is seen.
SPEED, SLOWER, TURN_S, LOST_AFTER_S, PATIENCE_S = 15.0, 50.0, 0.2, 6.0, 60.0
COORDINATOR = {"method": "default", "overlap_period_s": 3}


class Brake(threading.Thread):
    """Lets a program work for one part in SLOWER of the time."""

    def __init__(self, process):
        super().__init__(daemon=True)
        self.process, self.ends = process, False

    def run(self):
        while not self.ends and self.process.is_running:
            self.process.send(signal.SIGSTOP)
            time.sleep(TURN_S * (1.0 - 1.0 / SLOWER))
            self.process.send(signal.SIGCONT)
            time.sleep(TURN_S / SLOWER)

    def release(self):
        self.ends = True
        self.join()
        if self.process.is_running:
            self.process.send(signal.SIGCONT)


def planned(deployment):
    """What the coordinator wrote last."""
    try:
        return json.loads(deployment.plan.read_text())
    except (FileNotFoundError, ValueError):
        return None


def edges_of(deployment):
    plan = planned(deployment)
    return {robot: edge["id"] for edge in plan["edges"] for robot in edge["robots"]} if plan else {}


def plans(arguments, seconds):
    team, before = Team("intel", 6, seconds), load_average()
    steps = []
    with team.coordinated(COORDINATOR, speed=SPEED, preview_period_s=1.0, lost_after_s=LOST_AFTER_S) as deployment:
        def when(what, condition):
            deployment.wait_for(condition, PATIENCE_S, f"the coordinator does not act: {what}")
            steps.append((what, time.time() - deployment.began))
            return edges_of(deployment)
        first = when("all robots have come", lambda: len(edges_of(deployment)) == len(team.cuts))
        deployment.wait_for(lambda: time.time() >= deployment.began + 0.25 * seconds / SPEED, seconds, "")
        brake = Brake(deployment.programs["north"])
        brake.start()
        begun = time.time()
        slowed = when("the slow edge has fewer robots", lambda: list(edges_of(deployment).values()).count("north") < list(first.values()).count("north"))
        slowed_after_s = time.time() - begun
        speeds = {edge["id"]: edge["speed"] for edge in planned(deployment)["edges"]}
        brake.release()
        deployment.programs["south"].kill()
        begun = time.time()
        when("the killed edge has none", lambda: set(edges_of(deployment).values()) == {"north"})
        killed_after_s = time.time() - begun
        deployment.wait_for_drives(3 * seconds / SPEED + 240)
        lost = deployment.lost_scans()
        maps = deployment.wait_for_results(300)
        plan = planned(deployment)
    others, missing = different(outputs(maps), team.outputs_with(edges_of(deployment))), missing_scans(maps, team)
    goals = ([f"{len(others)} files differ: {', '.join(others[:3])}"] if others else []) + ([f"{missing} scans are missing"] if missing else []) + ([f"{lost} scans lost"] if lost else [])
    yield {"team": team.name, "seconds": seconds, "speed": SPEED, "moved": sum(slowed[robot] != first[robot] for robot in first), "slowed_after_s": slowed_after_s, "killed_after_s": killed_after_s,
           "speeds": speeds, "expected_s": plan["expected_seconds"], "actual_s": plan["actual_seconds"], "files": len(outputs(maps)), "different": len(others), "missing": missing,
           "steps": steps, "load": f"{before}, {load_average()}", "missed": goals}


def plans_cells(row):
    return (row["team"], f"{row['speed']:g}", f"{row['moved']}, after {row['slowed_after_s']:.0f} s", f"{row['speeds']['north']:.2g}, {row['speeds']['south']:.2g}", f"{row['killed_after_s']:.0f} s",
            f"{row['expected_s']:.1f} s", f"{row['actual_s']:.1f} s" if row["actual_s"] is not None else "-", row["missing"], f"{row['different']} of {row['files']}")
