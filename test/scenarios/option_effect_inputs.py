"""What the runs of option_effect_cases.py work on: simulated worlds, what the program makes of them, and logs written by hand."""
import ros1_bags
import support

CAMERA = "kind: {}, width: {}, height: {}, fx: {}, fy: {}, frames_per_second: {}"
FLAT = """
seed: 7
buildings: [{kind: apartment, furniture: {round: 0.3}, apartment: {width_m: 8, height_m: 7}}]
look: {posters_per_10_m: 3}
"""


def camera(name, kind, rate=8, width=200, more=""):
    return "{id: " + name + ", " + CAMERA.format(kind, width, width * 3 // 4, width * 0.75, width * 0.75, rate) + more + "}"


WORLDS = {
    # bent scans: the laser takes half the time between two of them to turn
    "lasers": FLAT + """
edges: 2
laser: {rays: 121, scans_per_second: 3, sweep_s: 0.15, max_range_m: 8}
robots:
  - {id: alpha, first_room: 0, last_room: 2, length_m: 14, laps: 2}
  - {id: beta, first_room: 1, length_m: 10}
""",
    # an inertial unit, and wheels that slip
    "turning": FLAT + """
laser: {rays: 91, scans_per_second: 5, max_range_m: 5}
imu: {readings_per_second: 50}
motion: {turn_rate_deg_per_s: 120}
odometry: {yaw_noise_deg: 2, slips_per_100_m: 30}
robots: [{id: alpha, first_room: 0, last_room: 2, length_m: 30}]
""",
    # two rounds of two rooms, which close loops
    "loops": FLAT + """
laser: {rays: 91, scans_per_second: 3, max_range_m: 5}
odometry: {noise_m: 0.05, yaw_noise_deg: 2, heading_drift_deg_per_m: 1, slips_per_100_m: 20}
robots: [{id: alpha, first_room: 0, last_room: 2, length_m: 30}]
""",
    # rooms that look alike, for alignments with rivals
    "alike": """
seed: 7
buildings: [{kind: repeated_rooms, repeated_rooms: {rooms: 4, clutter: 6}}]
laser: {rays: 121, scans_per_second: 2, max_range_m: 8}
robots:
  - {id: alpha, first_room: 0, last_room: 2, length_m: 22}
  - {id: beta, first_room: 1, last_room: 3, length_m: 22}
""",
    "cameras": FLAT + f"""
edges: 2
laser: {{rays: 91, scans_per_second: 3}}
cameras: [{camera("camera", "rgbd")}]
robots:
  - {{id: alpha, first_room: 0, last_room: 2, length_m: 6}}
  - {{id: beta, first_room: 0, last_room: 1, length_m: 5, start_s: 2}}
""",
    "stereo": FLAT + f"""
logs: {{scans: false}}
cameras: [{camera("camera", "stereo", 8, 320)}]
robots: [{{id: alpha, length_m: 4}}]
""",
    "mono": FLAT + f"""
logs: {{scans: false}}
cameras: [{camera("camera", "mono", 12, 320)}]
robots: [{{id: alpha, length_m: 5}}]
""",
    "rig": FLAT + f"""
cameras: [{camera("ahead", "rgbd", 8)}, {camera("side", "rgbd", 7, 200, ", yaw_deg: 90, x_m: 0")}]
logs: {{scans: false}}
robots: [{{id: alpha, length_m: 6}}]
""",
    "monocular": FLAT + f"""
cameras: [{camera("ahead", "mono", 12, 320)}, {camera("back", "mono", 10, 320, ", yaw_deg: 180, x_m: -0.1")}]
laser: {{rays: 31, scans_per_second: 5}}
robots: [{{id: alpha, length_m: 5}}]
""",
    # a loop, and a camera that is covered while it is carried on; with odometry, and as a folder of pictures without
    "ring": f"""
seed: 3
buildings: [{{kind: ring, seed: 3, furniture: {{round: 0.3}}, ring: {{width_m: 6, height_m: 5, corridor_width_m: 1.5, doors: 3, clutter: 4}}}}]
look: {{posters_per_10_m: 6}}
laser: {{rays: 31, scans_per_second: 1}}
motion: {{speed_min_m_per_s: 0.4, speed_max_m_per_s: 0.6}}
logs: {{layout: both, pictures: jpeg}}
cameras: [{{id: camera, kind: rgbd, width: 240, height: 180, fx: 150, fy: 150, frames_per_second: 6}}]
robots: [{{id: alpha, laps: 2, length_m: 19, kidnappings: [{{after_m: 16, skip_m: 1, duration_s: 4}}]}}]
""",
    "folder": FLAT + f"""
logs: {{layout: folders}}
cameras: [{camera("camera", "rgbd")}]
robots: [{{id: alpha, length_m: 1}}]
""",
}

# Inputs that runs of the program make, in this order.
INPUTS = {name: ("simulate", f"{{written}}/{name}.world.yaml") for name in WORLDS}
SHORT_SUBMAPS = ("--threads", "1", "--set", "laser.graph.front_end.submap_length_m=3")
INPUTS["maps"] = ("run", "{lasers}/run.yaml", *SHORT_SUBMAPS, "--set", "cloud.push_to=[alpha]")
INPUTS["words"] = ("vocabulary", "train", "{cameras}/alpha.rawlog", "--branching", "3", "--levels", "1")
INPUTS["model"] = ("profile", "{maps}")
INPUTS["doubles"] = ("run", "{alike}/run.yaml", *SHORT_SUBMAPS, "--set", "laser.graph.front_end.submap_length_m=2")
INPUTS["seen"] = ("run", "{cameras}/run.yaml", "--threads", "1", "--set", "sensor=rgbd")

# Files that are written by hand.
WRITTEN = {f"{name}.world.yaml": text for name, text in WORLDS.items()}


def room_log(error):
    """As support.room_lines, with odometry that is off by error(i)."""
    lines = []
    for i in range(30):
        x, y, heading = 2.0 + 0.05 * i, 2.0 + 0.02 * i, 0.01 * i
        ranges = support.room_ranges(x, y, heading)
        lines.append(support.carmen_scan(1000.0 + 0.2 * i, ranges, x + error(i)[0], y + error(i)[1], heading))
    return "\n".join(lines) + "\n"


def lost_log():
    """A robot without odometry, which is carried into a barrel for a second."""
    lines = []
    for i in range(30):
        ranges = [0.6 + 0.1 * (ray % 7 == 0) for ray in range(181)] if 12 <= i < 18 else support.room_ranges(2.0 + 0.05 * i, 2.0, 0.0)
        lines.append(support.carmen_scan(1000.0 + 0.2 * i, ranges, 0.0, 0.0, 0.0))
    return "\n".join(lines) + "\n"


def unstamped_g2o():
    """Scans of a pose graph in a file without stamps."""
    lines = []
    for i in range(20):
        x, y = 2.0 + 0.05 * i, 2.0
        ranges = " ".join(f"{value:.3f}" for value in support.room_ranges(x, y, 0.0))
        pose = f"{x:.3f} {y:.3f} 0"
        lines.append(f"VERTEX_SE2 {i} {pose}")
        if i > 0:
            lines.append(f"EDGE_SE2 {i - 1} {i} 0.05 0 0 100 0 0 100 0 400")
        lines.append(f"ROBOTLASER1 0 -1.570796 3.141593 0.017453 50.0 0.1 0 181 {ranges} 0 {pose} {pose} 0 0 0 0 0 0 host 0")
    return "\n".join(lines) + "\n"


_lines = support.room_lines(20)
WRITTEN["lost.log"] = lost_log()
WRITTEN["unstamped.g2o"] = unstamped_g2o()
WRITTEN["room.log"] = "\n".join(_lines) + "\n"
WRITTEN["late.log"] = "\n".join([*_lines[:10], _lines[11], _lines[10], *_lines[12:]]) + "\n"
WRITTEN["trace.csv"] = "0,1000\n5,2000\n"
# The wheels slip by 0.5 m to the side; by 3 m within 0.2 s.
WRITTEN["slip.log"] = room_log(lambda i: (0.0, 0.5 if i > 10 else 0.0))
WRITTEN["jump.log"] = room_log(lambda i: (3.0 if i > 10 else 0.0, 0.0))
# ROS: a robot, two robots in one bag, clouds with and without rings.
WRITTEN["robot.bag"] = ros1_bags.bag(ros1_bags.drive(20))
WRITTEN["robots.bag"] = ros1_bags.bag(ros1_bags.drive(20, "alpha") + ros1_bags.drive(20, "beta", 1.0))
WRITTEN["rings.bag"] = ros1_bags.bag(ros1_bags.cloud_drive(True))
WRITTEN["clouds.bag"] = ros1_bags.bag(ros1_bags.cloud_drive(False))
