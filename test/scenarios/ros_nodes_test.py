"""Nodes of ROS 1 on this machine: what robots publish becomes the map of the recording, whatever is killed meanwhile."""
import pickle
import shutil
import subprocess
import time
import unittest

import ros1_bags
import support
from ros_scenario import HERE, NODES, PYTHON, SHIFTS, RosScenario, drives


class RosNodes(RosScenario):
    def test_what_robots_publish_becomes_the_map_of_the_recording(self):
        node = self.team()
        player = self.play(drives(), 4.0, 1, "keep")
        self.await_word(player, "ended")
        self.finish(node)
        player.stdin.close()
        self.same_as_batch(40)

    def test_a_bag_that_rosbag_plays_is_mapped_and_tools_of_ros_read_what_nodes_publish(self):
        if shutil.which("rosbag") is None:
            self.skipTest("needs rosbag, of the Debian package python3-rosbag")
        (self.folder / "messages").write_bytes(pickle.dumps(drives()))
        self.run_python("""
import pickle, genpy, rosbag, roslib.message
with rosbag.Bag('team.bag', 'w') as bag:
    for topic, kind, stamp, data in pickle.load(open('messages', 'rb')):
        bag.write(topic, roslib.message.get_message_class(kind)().deserialize(data), genpy.Time.from_sec(stamp))
""")
        node = self.team()
        player = self.begin("rosbag", "play", "--quiet", "--delay", 8, "--rate", 4, "--topics", "/tf_static", *(f"/{robot}/{topic}" for robot in SHIFTS for topic in ("scan", "odom")),
                            "--bags", "team.bag")
        player.wait(60 * support.PATIENCE)
        self.assertEqual(player.returncode, 0, player.log.read_text())
        self.await_(lambda: "tb0 + tb1" in node.log.read_text() or "joined" in self.diagnostics(), "a joint preview")
        self.assertIn("nav_msgs/OccupancyGrid", self.tool("rostopic", "type", "/cloud/map"))
        self.assertIn("resolution: 0.05", self.tool("rostopic", "echo", "-n", "1", "/tb0/map/info"))
        links = self.tool("rostopic", "echo", "-n", "20", "/tf/transforms")
        for parent, child in (("team", "tb0/map"), ("team", "tb1/map")):
            self.assertRegex(links, f'frame_id: "{parent}"\n *child_frame_id: "{child}"')
        self.assertIn("std_srvs/Trigger", self.tool("rosservice", "type", "/team/finish"))
        self.finish(node)
        self.same_as_batch(40)

    def tool(self, *command):
        done = subprocess.run([str(word) for word in command], cwd=self.folder, env=self.variables, capture_output=True, text=True, timeout=60 * support.PATIENCE, check=False)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return done.stdout

    def test_maps_topics_and_services_show_the_same_cells(self):
        node = self.team()
        player = self.play(drives(), 8.0, 1, "keep")
        self.await_word(player, "ended")
        self.await_(lambda: "joined" in self.diagnostics() or "tb0 + tb1" in node.log.read_text(), "a joint preview")
        time.sleep(3.0)  # nothing comes any more: previews stay as they are
        self.call("/cloud/save_map", "map_msgs/SaveMap", f"__import__('std_msgs.msg').msg.String('{self.folder}/saved')")
        cells = self.run_python("""
import rospy, sys
from nav_msgs.msg import OccupancyGrid
rospy.init_node('saver', anonymous=True)
grid = rospy.wait_for_message('/cloud/map', OccupancyGrid, 20)
w, h = grid.info.width, grid.info.height
shades = {0: 254, 100: 0, -1: 205}
rows = [bytes(shades[c] for c in grid.data[y * w:(y + 1) * w]) for y in reversed(range(h))]
open('seen.pgm', 'wb').write(b'P5\\n%d %d\\n255\\n' % (w, h) + b''.join(rows))
print(grid.header.frame_id)
""").stdout
        self.assertEqual(cells.strip(), "team")
        seen, saved = ((self.folder / name).read_bytes() for name in ("seen.pgm", "saved/map.pgm"))
        size = seen[len(b"P5\n"):seen.index(b"255\n") + 4]
        self.assertEqual(seen.split(size, 1)[1], saved.split(size, 1)[1], "every cell, and the size")
        self.assertIn("width", self.call("/cloud/static_map", "nav_msgs/GetMap"))
        self.assertIn("result: 0", self.call("/cloud/load_map", "nav_msgs/LoadMap", f"'{self.folder}/saved/map.yaml'"))
        self.assertIn("result: 2", self.call("/cloud/load_map", "nav_msgs/LoadMap", "'nothing.yaml'"))
        frames = self.run_python("""
import math, rospy, time
from tf2_msgs.msg import TFMessage
rospy.init_node('listener', anonymous=True)
links = {}
def take(message):
    for one in message.transforms:
        t = one.transform
        links[one.header.frame_id, one.child_frame_id] = (t.translation.x, t.translation.y, 2 * math.atan2(t.rotation.z, t.rotation.w))
rospy.Subscriber('/tf', TFMessage, take)
wanted = [link for robot in ('tb0', 'tb1') for link in (('team', robot + '/map'), (robot + '/map', 'odom'))]
end = time.time() + 20
while time.time() < end and not all(link in links for link in wanted[:2]):
    time.sleep(0.1)
time.sleep(1)
for robot in ('tb0', 'tb1'):
    print(*(round(value, 3) for value in links['team', robot + '/map']))
""").stdout.splitlines()
        # Where they began, by the truth: tb1 0.8 m ahead of tb0.
        one, other = ([float(value) for value in line.split()] for line in frames)
        self.assertAlmostEqual(other[0] - one[0], 0.8, delta=0.05)
        self.assertAlmostEqual(other[1] - one[1], 0.0, delta=0.05)
        self.assertAlmostEqual(other[2] - one[2], 0.0, delta=0.02)
        self.finish(node)

    def diagnostics(self):
        return self.run_python("""
import rospy
from diagnostic_msgs.msg import DiagnosticArray
rospy.init_node('reader', anonymous=True)
print(rospy.wait_for_message('/diagnostics', DiagnosticArray, 20))
""").stdout

    def test_a_killed_node_goes_on_with_what_it_recorded(self):
        node = self.team()
        player = self.play(drives(scans=60), 4.0, 1, "keep")
        self.await_word(player, "begins")
        time.sleep(1.0)
        node.kill()
        node.wait()
        again = self.team()
        self.await_word(again, "goes on with the recording")
        self.await_word(player, "ended")
        self.finish(again)
        for robot in self.read_json("maps/summary.json")["robots"]:
            self.assertGreater(robot["scans"], 30)
        self.mapweave("run", "maps.logs/run.yaml", "--out", "batch")
        self.assertEqual((self.folder / "maps/team/map.pgm").read_bytes(), (self.folder / "batch/team/map.pgm").read_bytes())

    def test_a_bag_that_is_played_again_to_a_restarted_node_counts_once(self):
        node = self.team()
        self.await_word(self.play(drives(), 8.0, 1, "keep"), "ended")
        time.sleep(1.0)
        node.kill()
        node.wait()
        again = self.team()
        self.await_word(again, "goes on with the recording")
        self.await_word(self.play(drives(), 8.0), "ended")
        self.assertIn("jumped back", again.log.read_text())
        self.finish(again)
        self.same_as_batch(40)

    def test_a_team_that_is_killed_after_a_robot_s_drive_goes_on(self):
        node = self.team()
        self.await_word(self.play(drives(), 8.0, 1, "keep"), "ended")
        self.assertIn("success: True", self.call("/tb0/finish", "std_srvs/Trigger"))
        self.await_word(node, "robot tb0 has ended; 40 scans are mapped")
        node.kill()
        node.wait()
        again = self.team()
        self.await_word(again, "robot tb0 has ended its drive")
        self.await_word(again, "robot tb1 goes on with the recording")
        self.finish(again)
        self.same_as_batch(40)
        refused = self.team("--force")
        refused.wait(30 * support.PATIENCE)
        self.assertEqual(refused.returncode, support.BAD_INPUT)
        self.assertIn("finished recording of an earlier drive", refused.log.read_text())

    def test_topics_are_remapped_as_those_of_any_node(self):
        behind = [(topic.replace("/scan", "/rear/scan"), *rest) for topic, *rest in drives(robots={"tb0": 0.0}, scans=40) if topic == "/tb0/scan"]
        ahead = [(topic.replace("/tb0/scan", "/tb0/front/scan").replace("/tb0/odom", "/wheels/odometry"), *rest) for topic, *rest in drives(robots={"tb0": 0.0})]
        node = self.team("/tb0/scan:=/tb0/front/scan", "/tb0/odom:=/wheels/odometry", "/tb0/map:=/tb0/slam_map", robots=["tb0"])
        messages = sorted(ahead + behind, key=lambda message: message[2])
        (self.folder / "messages").write_bytes(pickle.dumps(messages))
        player = self.begin(PYTHON, "-B", HERE / "ros_player.py", "messages", 8.0, 1, MAPWEAVE_PLAYER="keep eager")
        self.await_word(node, "records /tb0/scan, /tb0/odom")
        self.await_word(player, "ended")
        self.assertIn("tb0/map", self.run_python("""
import rospy
from nav_msgs.msg import OccupancyGrid
rospy.init_node('looker', anonymous=True)
print(rospy.wait_for_message('/tb0/slam_map', OccupancyGrid, 20).header.frame_id)
""").stdout)
        self.finish(node)
        self.mapweave("run", "maps.logs/run.yaml", "--out", "batch")
        self.assertEqual((self.folder / "maps/team/map.mwdb").read_bytes(), (self.folder / "batch/team/map.mwdb").read_bytes())
        self.assertGreater(self.read_json("maps/summary.json")["robots"][0]["scans"], 20)

    def test_a_node_that_is_asked_to_end_ends_its_drives_and_writes_the_map(self):
        node = self.team("--set", "live.preview_period_s=0.1", robots=["tb0"])
        self.await_word(self.play(drives(robots={"tb0": 0.0}, scans=30), 4.0, 1, "keep"), "ended")
        self.run_python("import rosgraph, xmlrpc.client\n"   # as `rosnode kill` does
                        "xmlrpc.client.ServerProxy(rosgraph.Master('/t').lookupNode('/mapweave_team')).shutdown('/rosnode', 'user request')")
        node.wait(120 * support.PATIENCE)
        self.assertEqual(node.returncode, 0, node.log.read_text())
        self.assertTrue(self.has_said(node, "asks this node to end: user request"))
        self.assertGreater(self.read_json("maps/summary.json")["robots"][0]["scans"], 10)

    def test_a_robot_s_map_is_shown_from_its_first_scan_on(self):
        node = self.begin(NODES, "team", "tb0", "--out", "maps", "--port", "-1", "--set", "live.preview_period_s=1000", "--set", "reading.reorder_window_s=0.1")
        few = drives(robots={"tb0": 0.0}, scans=6)
        self.await_word(self.play(few, 1.0, 1, "keep"), "ended")
        print_first = """
import rospy
from nav_msgs.msg import OccupancyGrid, Path
rospy.init_node('looker', anonymous=True)
print(rospy.wait_for_message('/tb0/map', OccupancyGrid, 20).data.count(100), len(rospy.wait_for_message('/tb0/path', Path, 20).poses))
"""
        walls, poses = map(int, self.run_python(print_first).stdout.split())
        self.assertGreater(walls, 20)
        self.assertIn(poses, range(1, 6))
        node.kill()

    def test_a_killed_master_stops_nothing_and_a_new_one_knows_the_nodes(self):
        node = self.team()
        player = self.play(drives(), 4.0, 1, "keep")
        self.await_word(player, "begins")
        time.sleep(0.5)
        self.restart_master()
        self.await_word(player, "ended")
        self.await_word(node, "registers anew")
        self.finish(node)
        self.same_as_batch(40)

    def test_a_recording_that_is_played_in_a_loop_counts_once(self):
        self.run_python("import rosgraph; rosgraph.Master('/t').setParam('/use_sim_time', True)")
        node = self.team()
        player = self.play(drives(), 8.0, 1, "keep", "again", "clock")
        self.await_word(player, "ended")
        self.assertIn("jumped back", node.log.read_text())
        self.finish(node)
        self.same_as_batch(40)

    def test_scans_that_come_too_late_are_left_out_and_said(self):
        stalled = [(topic, kind, 1003.0 if topic == "/tb0/scan" and 1002.0 <= stamp < 1003.0 else stamp, data) for topic, kind, stamp, data in drives()]
        node = self.team()
        player = self.play(sorted(stalled, key=lambda message: message[2]), 4.0, 1, "keep")
        self.await_word(player, "ended")
        self.finish(node)
        self.assertIn("a message of /tb0/scan came", node.log.read_text())
        self.same_as_batch(37, 38, 40)
        self.assertEqual(self.read_json("maps/summary.json")["robots"][1]["scans"], 40)

    def test_transforms_may_come_late(self):
        late = [(topic, kind, stamp + 1.5 if topic == "/tf_static" else stamp, data) for topic, kind, stamp, data in drives()]
        node = self.team()
        player = self.play(sorted(late, key=lambda message: message[2]), 4.0, 1, "keep")
        self.await_word(player, "ended")
        self.finish(node)
        self.same_as_batch(40)

    def test_two_lasers_on_one_topic_a_frame_that_changes_and_moving_transforms_that_come_late(self):
        links = [("tb0/base_link", f"tb0/{name}", x, 0.0, 0.3, 0.0, 0.0) for name, x in (("laser", 0.2), ("lasez", 0.2), ("later", -0.1))]
        messages, scans = [], 0
        for topic, kind, stamp, data in drives():
            if topic == "/tb0/scan":   # a driver that was started again under another name; every fifth scan is another laser's
                data = data.replace(b"tb0/laser", b"tb0/later" if scans % 5 == 4 else b"tb0/lasez" if scans >= 20 else b"tb0/laser")
                scans += 1
                messages.append(("/tf", "tf2_msgs/TFMessage", stamp + 0.3, ros1_bags.transforms(stamp, links)[3]))
            if topic != "/tf_static" or b"tb0" not in data:
                messages.append((topic, kind, stamp, data))
        node = self.team()
        player = self.play(sorted(messages, key=lambda message: message[2]), 4.0, 1, "keep")
        self.await_word(player, "ended")
        self.finish(node)
        self.same_as_batch(32, 40)

    def test_a_robot_that_never_comes_is_named_and_the_others_are_mapped(self):
        node = self.team(robots=[*SHIFTS, "tb2"])
        player = self.play(drives(), 8.0, 1, "keep")
        self.await_word(player, "ended")
        self.assertIn("success: True", self.call("/team/finish", "std_srvs/Trigger"))
        node.wait(120 * support.PATIENCE)
        self.assertIn("has sensed nothing", node.log.read_text())
        self.assertTrue((self.folder / "maps/team/map.pgm").exists())

    def test_a_robot_that_is_killed_before_all_was_sent_sends_the_rest(self):
        self.kill_robot(self.start_broker())

    def test_a_robot_that_is_killed_before_all_was_sent_sends_the_rest_over_ros(self):
        self.kill_robot("ros")

    def kill_robot(self, broker):
        self.write("team.yaml", f"""
robots:
  - {{id: tb0, log: logs/tb0.mcap, edge: north}}
live: {{broker: "{broker}", preview_period_s: 0.5, store: store}}
""")
        cloud = self.begin(NODES, "cloud", "team.yaml", "--out", "maps")
        edge = self.begin(NODES, "edge", "team.yaml", "--name", "north")
        robot = self.begin(NODES, "robot", "team.yaml")
        player = self.play(drives(robots={"tb0": 0.0}, scans=60), 4.0, 1, "keep")
        self.await_word(player, "begins")
        time.sleep(1.0)
        edge.kill()   # what comes now is not confirmed
        edge.wait()
        self.await_word(player, "ended")
        self.call("/tb0/finish", "std_srvs/Trigger")
        self.await_word(robot, "ends its recording")
        time.sleep(1.0)
        robot.kill()
        robot.wait()
        self.assertTrue((self.folder / "logs/tb0.mcap.unsent").exists())
        robot = self.begin(NODES, "robot", "team.yaml")
        self.await_word(robot, "robot tb0 has ended its drive")
        edge = self.begin(NODES, "edge", "team.yaml", "--name", "north")
        for process in (robot, edge, cloud):
            process.wait(120 * support.PATIENCE)
            self.assertEqual(process.returncode, 0, process.log.read_text())
        self.assertIn("its edge has all 60 scans", robot.log.read_text())
        self.mapweave("run", "team.yaml", "--out", "batch")
        self.assertEqual((self.folder / "maps/team/map.mwdb").read_bytes(), (self.folder / "batch/team/map.mwdb").read_bytes())
        refused = self.begin(NODES, "robot", "team.yaml")
        refused.wait(30 * support.PATIENCE)
        self.assertEqual(refused.returncode, support.BAD_INPUT)
        self.assertIn("finished recording of an earlier drive", refused.log.read_text())
        self.assertIn("move it away", refused.log.read_text())

    def test_programs_of_a_deployment_are_nodes_too(self):
        self.deploy(self.start_broker())

    def test_programs_of_a_deployment_talk_over_ros_and_follow_a_coordinator(self):
        self.deploy("ros", "coordinator: {method: default, overlap_period_s: 1}")
        plan = self.read_json("plans/plan.json")
        self.assertTrue(plan["final"] and plan["done"], plan)

    def test_what_topics_cannot_do_is_said(self):
        self.write("team.yaml", "robots: [{id: tb0, log: logs/tb0.mcap, edge: north}]\nlive: {broker: ros}\n")
        for setting, words in (("live.keys=edge-north.keys", "topics of ROS know no keys"), ("edges=[{id: north, broker: 'nats://10.0.0.2:4222'}]", "a broker of its own")):
            edge = self.begin(NODES, "edge", "team.yaml", "--name", "north", "--set", setting)
            edge.wait(30 * support.PATIENCE)
            self.assertEqual(edge.returncode, support.BAD_INPUT)
            self.assertIn(words, edge.log.read_text())

    def deploy(self, broker, coordinated=""):
        self.write("team.yaml", f"""
robots:
  - {{id: tb0, log: logs/tb0.mcap, edge: north}}
  - {{id: tb1, log: logs/tb1.mcap, edge: south}}
live: {{broker: "{broker}", preview_period_s: 0.5, store: store}}
{coordinated}
""")
        cloud = self.begin(NODES, "cloud", "team.yaml", "--out", "maps")
        others = [self.begin(NODES, "coordinator", "team.yaml", "--out", "plans")] if coordinated else []
        edges = [self.begin(NODES, "edge", "team.yaml", "--name", name) for name in ("north", "south")]
        robots = [self.begin(NODES, "robot", "team.yaml", "--name", name) for name in SHIFTS]
        player = self.play(drives(), 4.0, 1, "keep")
        if coordinated:   # what programs say of themselves, and the plan, are with the master
            self.await_word(player, "begins")
            time.sleep(0.5)
            self.restart_master()
        self.await_word(player, "ended")
        self.assertIn("tb0", self.run_python("""
import rospy
from nav_msgs.msg import OccupancyGrid
rospy.init_node('looker', anonymous=True)
print(rospy.wait_for_message('/tb0/map', OccupancyGrid, 50).header.frame_id, rospy.wait_for_message('/north/map', OccupancyGrid, 50).header.frame_id)
""").stdout)
        for robot in SHIFTS:
            self.call(f"/{robot}/finish", "std_srvs/Trigger")
        for process in [cloud, *edges, *robots, *others]:
            process.wait(120 * support.PATIENCE)
        done = self.mapweave("run", "team.yaml", "--out", "batch", *(["--set", "coordinator.method=none"] if coordinated else []))
        for process in [*edges, *robots, *others]:
            self.assertEqual(process.returncode, 0, process.log.read_text())
        self.assertEqual(cloud.returncode, done.returncode, cloud.log.read_text())
        for result in [*(self.folder / "batch").glob("team*/map.mwdb"), *(self.folder / "batch/robots").glob("*/map.mwdb")]:
            live = self.folder / "maps" / result.relative_to(self.folder / "batch")
            self.assertEqual(live.read_bytes(), result.read_bytes(), result)


if __name__ == "__main__":
    support.main()
