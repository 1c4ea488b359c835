"""Programs that are killed and wires that are cut, slow or lose, while robots drive."""
import random
import signal
import statistics
import time

from benches.serve_bench.team import Team, load_average, missing_scans, other_than, stamps_that_show

FAULTS_SPEED, KILLS, STOPPED_S = 10.0, 3, 20.0   # of six programs and the broker 21 are killed
CUT_S, HOUR_S, HOUR_SPEED = 60.0, 3600.0, 60.0   # of data; the clock's while the cut of an hour lasts
SLOW_WIRE = {"delay_s": 0.3, "bytes_per_s": 64e3, "lost": 0.3}


def moments(deployment, seconds, seed):
    """(seconds after the drive's begin, who, seconds until it is started again), by time."""
    chance = random.Random(seed)
    return sorted((chance.uniform(0.05, 0.85) * seconds, name, chance.uniform(0.2, 3.0)) for name in deployment.all for _ in range(KILLS))


class Recovery:
    """From now on, when something is there again: until the cloud shows what each robot that drives sensed afterwards."""

    def __init__(self, deployment, who, showing):
        self.deployment, self.who, self.showing, self.at, self.took_s = deployment, who, showing, time.time(), None
        self.goals = {}   # {robot: stamp}

    def look(self):
        if self.took_s is None and self.is_over():
            self.took_s = time.time() - self.at

    def goal_of(self, robot):
        """The newest scan that shows something, at the robot's first word since that says of more than it ever said."""
        recorded = 0.0
        for status in self.deployment.board.of(f"robot-{robot}"):
            now = status["tiers"][0]["counts"]["recorded_seconds"]
            if status["said_at_ns"] * 1e-9 >= self.at and now > recorded:
                return max((stamp for stamp in self.showing[robot] if stamp <= self.showing[robot][0] + now), default=0.0)
            recorded = max(recorded, now)
        return None

    def is_over(self):
        shown = self.deployment.watch.newest("cloud")
        for robot in self.deployment.robots:
            if self.goals.get(robot) is None:
                self.goals[robot] = self.goal_of(robot)
            has_ended = self.deployment.programs[robot].process.poll() == 0
            if not has_ended and (self.goals[robot] is None or shown.get(robot, 0.0) < self.goals[robot] - 1e-4):
                return False
        return True


def watch_drives(deployment, recoveries, seconds):
    """False: all robots have ended."""
    for recovery in recoveries:
        recovery.look()
    deployment.expect_sound()
    if time.time() > deployment.began + 3 * seconds + 240:
        deployment.fail("robots still drive")
    time.sleep(0.05)
    return any(deployment.programs[robot].process.poll() != 0 for robot in deployment.robots)


def killed(deployment, seconds, seed, showing):
    """Kills and starts again; the recoveries, from when something was started."""
    recoveries, starts, plan = [], [], moments(deployment, seconds, seed)
    while watch_drives(deployment, recoveries, seconds) or starts:
        now = time.time()
        while plan and now >= deployment.began + plan[0][0]:
            _, name, away_s = plan.pop(0)
            if deployment.all[name].is_running:
                deployment.all[name].kill()
                starts.append((now + away_s, name))
        for at, name in [one for one in starts if now >= one[0]]:
            deployment.all[name].start()
            recoveries.append(Recovery(deployment, name, showing))
            starts.remove((at, name))
    return recoveries


def cut(deployment, seconds, away_s, showing):
    """Cuts the wires of all robots for a while of data: nothing comes through, and nobody is told."""
    speed = float(deployment.speed)
    deployment.wait_for(lambda: time.time() >= deployment.began + seconds / 3, seconds, "")
    deployment.relay.cut()
    time.sleep(away_s / speed)
    deployment.relay.mend()
    return watched(deployment, [Recovery(deployment, "wires", showing)], seconds + away_s / speed)


def watched(deployment, recoveries, seconds):
    while watch_drives(deployment, recoveries, seconds):
        pass
    return recoveries


def stopped(deployment, seconds, _, showing):
    """Stops the broker for a while."""
    deployment.wait_for(lambda: time.time() >= deployment.began + seconds / 3, seconds, "")
    deployment.broker.send(signal.SIGSTOP)
    time.sleep(STOPPED_S)
    deployment.broker.send(signal.SIGCONT)
    return watched(deployment, [Recovery(deployment, "broker", showing)], seconds)


def faults(arguments, seconds):
    team = Team("intel", 3, seconds)
    team.outputs_of_run()   # before programs compete with it
    showing = {robot: stamps_that_show(team.trajectory(team.folder / "run", robot)) for robot in team.cuts}
    rows = (("kills", f"{KILLS} x each of 6 programs and the broker killed, seed {arguments.seed}", killed, arguments.seed, None, FAULTS_SPEED),
            ("broker", f"the broker stopped for {STOPPED_S:g} s", stopped, None, None, FAULTS_SPEED),
            ("cut", f"robots' wires cut for {CUT_S:g} s", cut, CUT_S, {}, FAULTS_SPEED),
            ("hour", "robots' wires cut for an hour, longer than they drive", cut, HOUR_S, {}, HOUR_SPEED),
            ("slow", "robots' wires: 64 kB/s, 300 ms, 30 % of pieces lost", lambda deployment, seconds, _, showing: watched(deployment, [], seconds), None, SLOW_WIRE, FAULTS_SPEED))
    for name, what, disturb, how, wire, speed in rows:
        if arguments.faults and name not in arguments.faults.split(","):
            continue
        before = load_average()
        with team.deployment(watch_s=0.2, wire=wire, speed=speed, preview_period_s=1.0) as deployment:
            deployment.speed = speed
            recoveries = disturb(deployment, seconds / speed, how, showing)
            driven_s = time.time() - deployment.began
            lost = deployment.lost_scans()
            maps = deployment.wait_for_results(240)
        others, missing = other_than(maps, team), missing_scans(maps, team)
        times = [one.took_s for one in recoveries if one.took_s is not None]
        goals = ([f"{len(others)} files differ: {', '.join(others[:3])}"] if others else []) + ([f"{missing} scans are missing"] if missing else []) + ([f"{lost} scans lost"] if lost else [])
        yield {"what": what, "seconds": seconds, "speed": speed, "again": [(one.who, one.at - deployment.began, one.took_s) for one in recoveries], "times": times,
               "different": len(others), "files": len(team.outputs_of_run()), "drive_s": driven_s, "undisturbed_s": team.seconds / speed, "load": f"{before}, {load_average()}", "missed": goals}


def faults_cells(row):
    times = row["times"]
    took = f"{statistics.median(times):.1f} s ({max(times):.1f} s)" if times else "-"
    return row["what"], len(row["again"]), took, f"{row['drive_s']:.0f} s of {row['undisturbed_s']:.0f} s", row["files"], row["different"]
