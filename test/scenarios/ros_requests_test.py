"""What users ask of nodes of ROS 1 while robots drive: a new plan, a join undone, where a robot is."""
import json
import math
import time

import ros1_bags
import support
from ros_scenario import NODES, PYTHON, RosScenario, drives

PLANS = """
import rospy
from std_msgs.msg import String
rospy.init_node('looker', anonymous=True)
rospy.Subscriber('/coordinator/plan', String, lambda plan: print(*plan.data.split(), flush=True))
print('listens', flush=True)
rospy.spin()
"""
ANSWERS = """
import rospy
from rosgraph_msgs.msg import Log
rospy.init_node('listener', anonymous=True)
rospy.Subscriber('/rosout', Log, lambda said: print(said.level, said.msg, flush=True))
print('listens', flush=True)
rospy.spin()
"""
# A corridor with a niche every 4 m: what robots see in it fits in many places.
WALLS = [(0, 0, 60, 0)] + [(4 * k + a, b, 4 * k + c, d) for k in range(15) for a, b, c, d in
                           ((0, 2.4, 1.5, 2.4), (1.5, 2.4, 1.5, 3.0), (1.5, 3.0, 2.5, 3.0), (2.5, 3.0, 2.5, 2.4), (2.5, 2.4, 4, 2.4))]
STEP_M, STANDING = 0.1, 10


def corridor_ranges(x, y, heading, most_m=5.0, rays=181):
    ranges = []
    for i in range(rays):
        angle = heading + math.pi * (i / (rays - 1) - 0.5)
        c, s, nearest = math.cos(angle), math.sin(angle), math.inf
        for from_x, from_y, to_x, to_y in WALLS:
            along_x, along_y = to_x - from_x, to_y - from_y
            across = c * along_y - s * along_x
            if abs(across) > 1e-12:
                distance = ((from_x - x) * along_y - (from_y - y) * along_x) / across
                share = ((from_x - x) * s - (from_y - y) * c) / across
                if distance > 0 and 0 <= share <= 1:
                    nearest = min(nearest, distance)
        ranges.append(nearest if nearest < most_m else math.inf)
    return ranges


def corridor_drive(robot, x, y, heading, scans):
    """Straight on, and then it stands."""
    topics, messages = f"/{robot}/", [ros1_bags.transforms(1000.0, [(f"{robot}/base_link", f"{robot}/laser", 0.0, 0.0, 0.3, 0.0, 0.0)])]
    for i in range(scans + STANDING):
        driven, stamp = STEP_M * min(i, scans - 1), 1000.0 + 0.2 * i
        messages.append(ros1_bags.odometry(stamp, driven, 0.0, 0.0, topics + "odom", f"{robot}/base_link"))
        ranges = corridor_ranges(x + driven * math.cos(heading), y + driven * math.sin(heading), heading)
        messages.append(ros1_bags.scan(stamp, ranges, topics + "scan", f"{robot}/laser"))
    return messages


class RosRequests(RosScenario):
    def give_pose(self, topic, x, y, heading):
        """As RViz does: once, with its usual covariance."""
        self.run_python(f"""
import math, rospy
from geometry_msgs.msg import PoseWithCovarianceStamped
rospy.init_node('giver', anonymous=True)
publisher = rospy.Publisher('{topic}', PoseWithCovarianceStamped, queue_size=1)
pose = PoseWithCovarianceStamped()
pose.header.frame_id = 'team'
pose.pose.pose.position.x, pose.pose.pose.position.y = {x}, {y}
pose.pose.pose.orientation.z, pose.pose.pose.orientation.w = math.sin({heading} / 2), math.cos({heading} / 2)
pose.pose.covariance[0] = pose.pose.covariance[7] = 0.25
pose.pose.covariance[35] = 0.06853891945200942
while publisher.get_num_connections() == 0:
    rospy.sleep(0.05)
publisher.publish(pose)
rospy.sleep(0.5)
""")

    def listen(self, code):
        listener = self.begin(PYTHON, "-c", code)
        self.await_word(listener, "listens")
        return listener

    def test_a_coordinator_that_is_asked_plans_anew_and_shows_its_plan(self):
        broker = self.start_broker()
        self.write("model.json", json.dumps({"edge_fusion": {"fixed_s": 0, "per_scan_s": 0, "per_scan_pair_s": 1.0, "per_shared_scan_s": 0}}))
        # All on one edge, and it decides by itself only where a robot comes.
        self.write("team.yaml", f"""
robots:
  - {{id: tb0, log: logs/tb0.mcap, edge: north}}
  - {{id: tb1, log: logs/tb1.mcap, edge: north}}
edges: [{{id: north}}, {{id: south}}]
coordinator: {{method: default, model: model.json, overlap_period_s: 1000}}
live: {{broker: "{broker}", preview_period_s: 0.5, store: store}}
""")
        cloud = self.begin(NODES, "cloud", "team.yaml", "--out", "maps")
        edges = [self.begin(NODES, "edge", "team.yaml", "--name", name) for name in ("north", "south")]
        coordinator = self.begin(NODES, "coordinator", "team.yaml", "--out", "plans")
        plans = self.listen(PLANS)
        robots = [self.begin(NODES, "robot", "team.yaml", "--name", name) for name in ("tb0", "tb1")]
        self.await_word(self.play(drives(), 4.0, 1, "keep"), "ended")

        def shown():
            return [json.loads(line) for line in plans.log.read_text().splitlines()[1:]]

        self.await_(lambda: shown() and len(shown()[-1]["edges"]) == 2, "a plan for both robots")
        time.sleep(3.0)   # edges have shown the coordinator their maps
        before = shown()
        self.assertEqual(before[-1]["edges"], {"tb0": "north", "tb1": "north"}, "nobody asked")
        self.assertIn("success: True", self.call("/coordinator/replan", "std_srvs/Trigger"))
        self.await_(lambda: len(shown()) > len(before), "a new plan")
        self.assertEqual(shown()[-1]["plan"], before[-1]["plan"] + 1)
        self.assertEqual(sorted(shown()[-1]["edges"].values()), ["north", "south"], "each has an edge to itself")
        self.call("/coordinator/replan", "std_srvs/Trigger")
        self.await_(lambda: len(shown()) > len(before) + 1, "the plan again")
        self.assertEqual(shown()[-1], shown()[-2], "nothing has changed")
        for robot in ("tb0", "tb1"):
            self.call(f"/{robot}/finish", "std_srvs/Trigger")
        for process in [cloud, *edges, *robots, coordinator]:
            process.wait(120 * support.PATIENCE)
        self.assertEqual(self.read_json("maps/summary.json")["robots"][0]["edge"], shown()[-1]["edges"]["tb0"])

    def test_users_undo_a_join_and_give_a_pose(self):
        node = self.team()
        player = self.play(drives(), 8.0, 1, "keep")
        self.await_word(node, "one map of tb0 + tb1")
        self.assertIn("no robot 'tb9'", self.call("/cloud/undo_join", "mapweave_msgs/UndoJoin", "'tb0', 'tb9'"))
        self.give_pose("/tb1/initialpose", 1.0, 0.0, 0.0)
        self.await_word(node, "its pose in the team's map was given")
        self.assert_poses_are_answered()
        self.assertIn("success: True", self.call("/cloud/undo_join", "mapweave_msgs/UndoJoin", "'tb0', 'tb1'"))
        self.await_word(player, "ended")
        self.assertIn("success: True", self.call("/team/finish", "std_srvs/Trigger"))
        node.wait(120 * support.PATIENCE)
        self.assertEqual(node.returncode, support.APART, node.log.read_text())
        self.assertEqual(self.read_json("maps/merges.json")[0]["decision"], "refused")

    def set_pose(self, *numbers):
        return self.call("/cloud/set_initial_pose", "mapweave_msgs/SetInitialPose", ", ".join(str(number) for number in numbers))

    def assert_poses_are_answered(self):
        answer = self.set_pose("'tb1'", 1.0, 0.0, 0.0, 0.5, 0.1)
        self.assertIn("success: True", answer)
        self.assertIn("its pose in the team's map was given", answer)
        for numbers, why in ((("'tb9'", 1.0, 0.0, 0.0, 0.0, 0.0), "no robot 'tb9'"), (("'tb1'", "float('nan')", 0.0, 0.0, 0.0, 0.0), "is no pose"),
                             (("''", 1.0, 0.0, 0.0, 0.0, 0.0), "all robots that have a map are in the largest one")):
            answer = self.set_pose(*numbers)
            self.assertIn("success: False", answer)
            self.assertIn(why, answer)

    def test_a_pose_from_rviz_is_a_prior_of_the_robot_that_is_apart(self):
        drives_apart = corridor_drive("tb0", 14.0, 1.2, 0.0, 50) + corridor_drive("tb1", 15.2, 1.3, 0.02, 40)
        node = self.team()
        answers = self.listen(ANSWERS)
        self.await_word(self.play(sorted(drives_apart, key=lambda message: message[2]), 8.0, 1, "keep"), "ended")
        time.sleep(2.0)   # the newest preview has both where they stand
        driven = STEP_M * 39
        self.give_pose("/initialpose", 1.2 + driven, 0.1 + 0.02 * driven, 0.02)   # in the frame of the larger map: where tb0 began
        self.await_word(answers, "2 robot tb1: its pose in the team's map was given")
        self.await_word(node, "one map of tb0 + tb1")
        self.assertTrue((self.folder / "maps.store/requests.json").exists(), "a node that is started again knows it")
        self.finish(node)
        verdict = self.read_json("maps/merges.json")[0]
        self.assertEqual((verdict["decision"], verdict["prior"]["contradicted"]), ("accepted", False))
        self.assertLess(verdict["prior"]["off_m"], 0.3)
        self.mapweave("run", "maps.logs/run.yaml", "--out", "batch", code=support.APART)   # without the pose

    def test_a_pose_from_rviz_that_may_be_of_several_robots_or_of_none_is_left_out_and_said(self):
        names = ["tb0", "tb1", "tb2", "tb3"]
        node = self.team(robots=names)
        answers = self.listen(ANSWERS)
        self.give_pose("/initialpose", 1.0, 1.0, 0.0)
        self.await_word(answers, "4 a pose on initialpose is left out: there is no map yet")
        self.await_word(self.play(drives(), 8.0, 1, "keep"), "ended")
        self.await_word(node, "one map of tb0 + tb1")
        time.sleep(1.0)
        self.give_pose("/initialpose", 1.0, 1.0, 0.0)
        self.await_word(answers, "4 a pose on initialpose is left out: all robots that have a map are in the largest one")
        messages = corridor_drive("tb2", 14.0, 1.2, 0.0, 40) + corridor_drive("tb3", 15.2, 1.3, 0.02, 40)
        self.await_word(self.play(sorted(messages, key=lambda message: message[2]), 8.0, 1, "keep"), "ended")
        time.sleep(2.0)
        self.give_pose("/initialpose", 1.0, 1.0, 0.0)
        self.await_word(answers, "4 a pose on initialpose is left out: it may be of tb2 or tb3, which are apart from the largest map")
        self.assertFalse((self.folder / "maps.store/requests.json").exists(), "nothing was asked for")
        node.kill()


if __name__ == "__main__":
    support.main()
