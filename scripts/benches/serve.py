"""Deployments: robots, edges and a cloud as programs of their own, through a broker, all on this machine

Needs the program (scripts/build), nats-server, and laser/ below MAPWEAVE_DATA (default ../shared/data). Logs are cut into robots that drive at once, each with a third of what the next one sees where
the log is long enough. Parts:
  same     intel as 3 robots on 2 edges, 20 times as fast as sensed: the bytes of the maps are those of `run`
  latency  at sensor speed: from a scan to the edge's preview and to the cloud's that have it
  load     3, 8 and 20 robots of fr079 at sensor speed: what each program uses, what goes over the wires, and that no scan is lost
  cameras  the same of 8 simulated robots with cameras, which map on board
  faults   every program and the broker killed three times at random moments, at 10 times the speed; the broker stopped for 20 s; robots' wires cut for a minute and an hour of data, and slow ones that lose:
           the bytes of the undisturbed maps
  cluster  `run --cluster` with 3 workers, intel as 3 robots and tum_fr1_rpy as 2 cameras: the bytes of `run`; tum_fr1_rpy as programs of a deployment, too
  plans    6 robots and a coordinator, 15 times as fast: one of two edges becomes slow, then the other one is killed; the map of a run with the last plan
  flat     a long simulated drive, 40 times as fast as sensed: memory, disk and the time between previews after a quarter, half and all of it
Writes tables between <!-- bench:serve --> and <!-- /bench --> of datasets/RESULTS.md, and out/bench/serve.json; a partial run keeps the other tables. Exit code 5 where a goal is missed, which the table's last column
says. Latencies are true on an idle machine alone: the load average when a row began and ended stands in it. Everything takes some twenty minutes.
"""
import json
import math
import statistics
import sys
import time

from benches import common
from benches.serve_bench import deployment as live
from benches.serve_bench.cluster import cluster, cluster_cells
from benches.serve_bench.faults import faults, faults_cells
from benches.serve_bench.plans import plans, plans_cells
from benches.serve_bench.team import Team, load_average, missing_scans, other_than, scans_of, stamps_that_show, write_configuration
from benches.teams import some, tables_of

GOAL_EDGE_S, GOAL_CLOUD_S = 1.0, 3.0   # 95 of 100 scans are in the preview by then
FLAT_SPEED = 40.0   # edges keep up, so that robots drive for as long as is mapped
FLAT, GOAL_FLAT_MB = ("robot", "broker"), 20.0   # in an hour; edges and the cloud hold maps, journals all that was sensed
FLAT_WORLD = """\
seed: 7
buildings:
  - {{kind: apartment, apartment: {{width_m: 18, height_m: 13}}}}
robots:
  - {{id: alpha, edge: north, length_m: {length:.0f}, first_room: 0, last_room: 3}}
  - {{id: beta, edge: south, length_m: {length:.0f}, first_room: 2, last_room: 5}}
"""
FLAT_M_PER_S = 0.336   # robots of the simulation, turns included
CAMERA_WORLD = """\
seed: 7
cameras:
  - {{id: front, kind: rgbd, width: 320, height: 240, fx: 262, fy: 262, frames_per_second: 10}}
look: {{posters_per_10_m: 3}}
buildings:
  - {{kind: apartment, furniture: {{round: 0.3}}, apartment: {{width_m: 18, height_m: 13}}}}
robots:
"""


def add_arguments(parser):
    parser.add_argument("--parts", default=list(PARTS), type=some(PARTS, "part"), metavar="NAME,...", help=f"default: all of {','.join(PARTS)}")
    parser.add_argument("--seconds", type=float, metavar="S", help="that robots drive, in data (default: " + ", ".join(f"{name} {seconds}" for name, (_, seconds) in PARTS.items()) + "); leaves RESULTS.md as it is")
    parser.add_argument("--rows", default="", metavar="LOG:ROBOTS,...", help="latency, load: only these, as in fr079:8; leaves RESULTS.md as it is")
    parser.add_argument("--faults", default="", metavar="NAME,...", help="faults: only these of kills, broker, cut, hour and slow; leaves RESULTS.md as it is")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="faults: of the moments (default: %(default)s)")
    parser.add_argument("--dry-run", action="store_true", help="leave RESULTS.md as it is")


# --- same

def same(arguments, seconds):
    team = Team("intel", 3, seconds)
    before, speed = load_average(), 20.0
    team.outputs_of_run()
    with team.deployment(speed=speed) as deployment:
        deployment.wait_for_drives(seconds / speed + 120)
        driven_s = time.time() - deployment.began
        maps = deployment.wait_for_results(180)
        done_s = time.time() - deployment.began
    others, missing = other_than(maps, team), missing_scans(maps, team)
    goals = ([f"{len(others)} files differ: {', '.join(others[:3])}"] if others else []) + ([f"{missing} scans are missing"] if missing else [])
    yield {"team": team.name, "seconds": team.seconds, "speed": speed, "scans": sum(len(cut.scans) for cut in team.cuts.values()), "files": len(team.outputs_of_run()), "different": len(others),
           "drive_s": driven_s, "done_s": done_s, "load": f"{before}, {load_average()}", "missed": goals}


def same_cells(row):
    return row["team"], row["scans"], f"{row['speed']:g}", f"{row['drive_s']:.0f} s of {row['seconds'] / row['speed']:.0f} s", f"{row['done_s'] - row['drive_s']:.1f} s", row["files"], row["different"]


# --- latency

class Latencies:
    """Of scans, by the first preview that is as new. A map is shown once it has ten scans: those wait for it."""

    def __init__(self):
        self.first_s, self.later_s, self.shown_after_s, self.never = [], [], [], 0

    def add(self, shown, stamps, begun, first, end):
        """Of a robot; `end`: what was sensed before must be in a preview."""
        place = 0
        self.shown_after_s += [shown[0][0] - begun] if shown else []
        for stamp in stamps:
            while place < len(shown) and shown[place][1] < stamp - 1e-4:
                place += 1
            if place < len(shown):
                (self.later_s if place else self.first_s).append(shown[place][0] - begun - (stamp - first))
            elif stamp < end:
                self.never += 1

    def numbers(self):
        values = self.first_s + self.later_s
        return {"median_s": statistics.median(values), "p95_s": quantile(values, 0.95), "longest_s": max(self.later_s), "shown_after_s": max(self.shown_after_s), "counted": len(values), "never": self.never}


def quantile(values, share):
    return sorted(values)[min(len(values) - 1, int(share * len(values)))] if values else math.nan


def latency(arguments, seconds):
    for log, count in chosen_rows(arguments, (("intel", 3), ("fr079", 2))):
        team, before, period_s = Team(log, count, seconds), load_average(), 0.5
        with team.deployment(watch_s=0.05, preview_period_s=period_s) as deployment:
            deployment.wait_for_drives(seconds + 60)
            begun = {robot: deployment.begun(robot, 1.0) for robot in team.cuts}
            shown = {tier: dict(robots) for tier, robots in deployment.watch.shown.items()}
            lost = deployment.lost_scans()
            maps = deployment.wait_for_results(120)
        row, goals = {"team": team.name, "scans": 0, "period_s": period_s, "load": f"{before}, {load_average()}", "seconds": seconds}, []
        stamps = {robot: stamps_that_show(team.trajectory(maps, robot)) for robot in team.cuts}
        row["scans"] = sum(map(len, stamps.values()))
        for tier, goal_s in (("edge", GOAL_EDGE_S), ("cloud", GOAL_CLOUD_S)):
            found = Latencies()
            for robot, cut in team.cuts.items():
                found.add(shown[team.edges[robot] if tier == "edge" else "cloud"].get(robot, []), stamps[robot], begun[robot], cut.stamps[0], cut.stamps[-1] - goal_s)
            row[tier] = found.numbers()
            if row[tier]["p95_s"] > goal_s:
                goals.append(f"{tier}: p95 {row[tier]['p95_s']:.2f} s, goal {goal_s:g} s")
            if found.never:
                goals.append(f"{tier}: {found.never} scans in no preview")
        if lost:
            goals.append(f"{lost} scans lost")
        yield {**row, "missed": goals}


def latency_cells(row):
    return (row["team"], row["scans"], f"{row['period_s']:g} s", *(f"{row[tier][key]:.2f} s" for tier in ("edge", "cloud") for key in ("median_s", "p95_s", "longest_s", "shown_after_s")))


# --- load

def chosen_rows(arguments, rows):
    return [row for row in rows if not arguments.rows or f"{row[0]}:{row[1]}" in arguments.rows.split(",")]


def used(deployment, seconds):
    """By kind of program: of all together processors, of the largest MB, and of all kB/s sent and received."""
    kinds = {"robots": list(deployment.robots), "edges": deployment.edges, "cloud": ["cloud"], "broker": ["broker"]}
    usage = deployment.usage
    return {kind: {"cores": sum(deployment.all[name].cpu_s for name in names) / seconds,
                   "sent": sum(usage.sent.get(name, 0) for name in names) / seconds / 1000, "received": sum(usage.received.get(name, 0) for name in names) / seconds / 1000}
            for kind, names in kinds.items()}, {kind: max(deployment.all[name].peak_mb for name in names) for kind, names in kinds.items()}


def loaded(deployment, name, seconds, sensed, count_of):
    """A row of what programs use while robots drive; the peaks of memory with the final merge."""
    before = load_average()
    with deployment:
        deployment.wait_for_drives(3 * seconds + 120)
        driven_s = time.time() - deployment.began
        use, _ = used(deployment, driven_s)
        lost = deployment.lost_scans()
        maps = deployment.wait_for_results(300)
        _, peaks = used(deployment, driven_s)
    for kind, peak in peaks.items():
        use[kind]["peak_mb"] = peak
    missing = sensed - count_of(maps)
    goals = ([f"{lost} scans lost on the way"] if lost else []) + ([f"{missing} of {sensed} are not in the map"] if missing else [])
    return {"team": name, "sensed": sensed, "missing": missing, "robots": len(deployment.robots), "drive_s": driven_s, "seconds": seconds, "use": use,
            "load": f"{before}, {load_average()}", "missed": goals}


def load(arguments, seconds):
    for log, count in chosen_rows(arguments, (("fr079", 3), ("fr079", 8), ("fr079", 20))):
        team = Team(log, count, seconds)
        sensed = sum(len(cut.scans) for cut in team.cuts.values())
        yield loaded(team.deployment(preview_period_s=2.0), team.name, seconds, sensed, lambda maps: sum(scans_of(maps).values()))


def cameras(arguments, seconds):
    folder = common.OUT / "serve" / f"cameras-{seconds:g}"
    folder.mkdir(parents=True, exist_ok=True)
    names = [f"r{i:02}" for i in range(8)]
    edges = {name: ("north" if i < 4 else "south") for i, name in enumerate(names)}
    robots = "".join(f"  - {{id: {name}, edge: {edges[name]}, length_m: {0.3 * seconds:.1f}, first_room: {i % 4}}}\n" for i, name in enumerate(names))
    (folder / "world.yaml").write_text(CAMERA_WORLD.format() + robots)
    common.mapweave("simulate", folder / "world.yaml", "--out", folder / "logs", "--force")
    frames, driven_s = 0, 0.0
    for name in names:
        contents = json.loads(common.mapweave("inspect", folder / f"logs/{name}.rawlog", "--json")[1])
        frames += sum(sensor["count"] for sensor in contents["sensors"] if "camera" in sensor)
        driven_s = max(driven_s, contents["duration_s"])
    configuration = write_configuration(folder, {name: f"logs/{name}.rawlog" for name in names}, edges, "rgbd")
    deployment = live.Deployment(folder, configuration, edges, {"preview_period_s": 2.0}, 0.25)
    yield loaded(deployment, "8 robots with depth cameras, 320 x 240, 10 frames/s", driven_s, frames, frames_of)


def frames_of(maps):
    return sum(camera["frames"] for robot in json.loads((maps / "summary.json").read_text())["robots"] for camera in robot["cameras"])


def load_cells(row):
    use, count = row["use"], row["robots"]
    sizes = ", ".join(f"{use[kind]['peak_mb']:.0f}" for kind in ("robots", "edges", "cloud", "broker"))
    processors = ", ".join(f"{value:.3f}" for value in (use["robots"]["cores"] / count, use["edges"]["cores"], use["cloud"]["cores"], use["broker"]["cores"]))
    return (row["team"], row["sensed"], row["missing"], f"{row['drive_s']:.0f} s of {row['seconds']:.0f} s", processors, sizes, f"{use['robots']['sent'] / count:.1f}, {use['robots']['received'] / count:.1f}",
            f"{use['cloud']['received']:.1f}, {use['cloud']['sent']:.1f}")


# --- flat

def flat(arguments, seconds):
    folder, before = common.OUT / "serve" / f"flat-{seconds:g}", load_average()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "world.yaml").write_text(FLAT_WORLD.format(length=FLAT_M_PER_S * seconds))
    common.mapweave("simulate", folder / "world.yaml", "--out", folder / "logs", "--force")
    total = sum(json.loads(common.mapweave("inspect", folder / f"logs/{robot}.rawlog", "--json")[1])["scans"] for robot in ("alpha", "beta"))
    hours = seconds / 3600
    with live.Deployment(folder, folder / "logs/run.yaml", {"alpha": "north", "beta": "south"}, {"speed": FLAT_SPEED, "preview_period_s": 5.0}, 0.25) as deployment:
        samples, marks = {}, [0.25, 0.5]
        while (mapped := mapped_scans(deployment)) < total and deployment.programs["cloud"].is_running:
            share = mapped / total
            if marks and share >= marks[0]:
                samples[marks.pop(0)] = sizes_of(deployment, share)
            elif share > 0.9:
                samples[1.0] = sizes_of(deployment, share)
            deployment.expect_sound()
            if time.time() > deployment.began + 600:
                deployment.fail("it is not mapped after 10 minutes")
            time.sleep(0.2)
        mapped_s = time.time() - deployment.began
        deployment.wait_for_results(300)
    done_s = time.time() - deployment.began
    hours_between = (samples[1.0].pop("share") - samples[0.5].pop("share")) * hours
    for name, end in samples[1.0].items():
        quarter, half = samples[0.25][name], samples[0.5][name]
        more = (end - half) / hours_between
        has_goal = name.startswith(FLAT)
        yield {"what": name, "hours": hours, "scans": total, "wall_s": mapped_s, "done_s": done_s, "quarter": quarter, "half": half, "end": end, "per_hour": more, "load": f"{before}, {load_average()}",
               "has_goal": has_goal, "missed": [f"{name}: {more:.0f} MB more in an hour, goal {GOAL_FLAT_MB:g}"] if has_goal and more > GOAL_FLAT_MB else []}


def mapped_scans(deployment):
    return sum(counts["scans"] for edge in deployment.edges for counts in deployment.watch.links(edge).values())


def sizes_of(deployment, share):
    names = {"robot": list(deployment.robots), "edge": deployment.edges, "cloud": ["cloud"], "broker": ["broker"]}
    sizes = {f"{kind}, memory, MB": max(deployment.all[name].resident_mb for name in of) for kind, of in names.items()}
    sizes |= {f"{what}, disk, MB": size for what, size in deployment.stored_mb().items()}
    for kind in ("edge", "cloud"):
        sizes[f"{kind}, s from preview to preview"] = max((deployment.watch.between_previews_s(name) for name in names[kind]), default=math.nan)
    return {"share": share, **sizes}


def flat_cells(row):
    return row["what"], f"{row['hours']:.2g} h, {row['scans']} scans", f"{row['wall_s']:.0f} s, {row['done_s']:.0f} s", *("-" if math.isnan(row[key]) else f"{row[key]:.1f}" for key in ("quarter", "half", "end", "per_hour"))


# Title of the table, its columns, cells of a row.
LOAD_HEADERS = ("team", "scans or frames", "missing in the map", "drive", "processors: a robot, all edges, the cloud, the broker", "peak, MB: a robot, an edge, the cloud, the broker", "a robot's wire, kB/s: up, down", "the cloud's wires, kB/s: up, down")
TABLES = {
    "same": ("The maps of `run`, byte for byte", ("team", "scans", "times sensor speed", "drive", "map after it", "files", "different"), same_cells),
    "cluster": ("Runs that workers do, and cameras as programs: the bytes of `run`", ("team", "how", "`run` alone", "it took", "files", "different"), cluster_cells),
    "latency": ("From a scan to previews that have it, at sensor speed", ("team", "scans that show something", "previews every", "edge, median", "p95", "longest once shown", "a robot is shown after, at most", "cloud, median", "p95", "longest once shown", "a robot is shown after, at most"), latency_cells),
    "load": ("What programs use at sensor speed", LOAD_HEADERS, load_cells),
    "cameras": ("The same of cameras", LOAD_HEADERS, load_cells),
    "faults": ("Programs that are killed, wires that are cut: intel as 3 robots, 10 times as fast (the hour: 60 times)", ("what", "times", "the cloud shows what was sensed since after, median (longest)", "drive", "files", "other than undisturbed"), faults_cells),
    "plans": ("A coordinator: one edge becomes 50 times slower, then the other one is killed", ("team", "times sensor speed", "robots that leave the slow edge", "measured speed: slow edge, other", "robots of the killed edge go after", "mapping all and merging: expected", "it took", "scans missing", "files other than a run's"), plans_cells),
    "flat": ("A long drive, 40 times as fast as sensed", ("what", "drive", "mapped in, done in", "after a quarter", "after half", "at the end", "more in an hour of it"), flat_cells),
}
PARTS = {"same": (same, 900), "cluster": (cluster, 900), "latency": (latency, 120), "load": (load, 60), "cameras": (cameras, 40), "faults": (faults, 900), "plans": (plans, 1200), "flat": (flat, 3600)}


def table_of(part, rows):
    title, headers, cells = TABLES[part]
    return title, common.table((*headers, "load average", "goals"), [(*cells(row), row["load"], "missed: " + "; ".join(row["missed"]) if row["missed"] else "met" if row.get("has_goal", True) else "none") for row in rows])


def run(arguments):
    common.need(common.PROGRAM, "run scripts/build")
    if live.BROKER is None:
        common.give_up("there is no nats-server; it is a Debian package of this name")
    tables, missed, kept = {}, [], common.OUT / "serve.json"
    measured = json.loads(kept.read_text())["parts"] if kept.exists() else {}
    for part in arguments.parts:
        measure, seconds = PARTS[part]
        rows = []
        for row in measure(arguments, arguments.seconds or seconds):
            rows.append(row)
            print(json.dumps(row), file=sys.stderr)
            missed += [f"{part}: {goal}" for goal in row["missed"]]
        measured[part] = rows
        title, text = table_of(part, rows)
        tables[title] = text
        print(f"{title}:\n\n{text}\n")
        common.write_json("serve", {"machine": common.machine(), "commit": common.commit(), "parts": measured})
    tables = {**tables_of(common.results_text("serve")), **tables}
    ordered = [(title, tables[title]) for title, _, _ in TABLES.values() if title in tables]
    text = "\n\n".join(f"{title}:\n\n{table}" for title, table in ordered) + f"\n\nMeasured by `scripts/bench serve` on {common.machine()}, all programs on one machine."
    if not (arguments.dry_run or arguments.seconds or arguments.rows):
        common.write_results("serve", text)
    for one in missed:
        print("missed:", one)
    return 5 if missed else 0
