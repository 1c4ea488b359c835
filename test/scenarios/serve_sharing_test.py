"""Cameras of robots that are programs of their own share while they drive, through a broker on this machine, though their edge is killed."""
import json
import shutil
import signal
import time

import serve_test
import support

WORLD = """\
seed: 7
buildings:
  - {kind: apartment, furniture: {round: 0.3}, apartment: {width_m: 10, height_m: 8}}
look: {posters_per_10_m: 3}
cameras:
  - {id: camera, kind: rgbd, width: 320, height: 240, fx: 262, fy: 262, frames_per_second: 12}
robots:
  - {id: alpha, edge: north, first_room: 0, last_room: 2, length_m: 9}
  - {id: beta, edge: north, first_room: 0, last_room: 2, order: back, length_m: 9}
"""


class ServeSharing(serve_test.WithBroker):
    def error(self, out):
        """Of both robots, in one frame."""
        done = self.mapweave("evaluate", "trajectory", "--estimate", f"{out}/team", "--reference", "logs", "--align", "se3", "--json")
        return json.loads(done.stdout)["ate_translation_rmse_m"]

    def cameras(self, out):
        return [robot["cameras"][0] for robot in self.read_json(f"{out}/summary.json")["robots"]]

    def share(self, share):
        """An edge is killed in the middle, and begins again."""
        self.mapweave("simulate", self.write("world.yaml", WORLD), "--out", "logs")
        shared = ["--set", "sensor=rgbd", "--set", f"server.share={share}"]
        self.mapweave("run", "logs/run.yaml", *shared, "--out", "run", code=(support.DONE, support.APART), seconds=300)
        port = serve_test.free_port()
        talk = [*shared, "--set", f"live.broker={self.start_broker()}", "--set", f"live.speed={1.0 / support.PATIENCE}"]
        start_edge = lambda: self.start("serve", "edge", "logs/run.yaml", *talk, "--set", f"live.page_port={port}")
        counts = lambda: {key: value for tier in json.loads(serve_test.ask(port, "/status.json")[1] or '{"tiers": []}')["tiers"] for key, value in tier["counts"].items()}
        cloud = self.start("serve", "cloud", "logs/run.yaml", "--out", "live", *talk)
        edge = start_edge()
        robots = [self.start("serve", "robot", "logs/run.yaml", "--name", name, *talk) for name in ("alpha", "beta")]
        self.wait_for(lambda: counts().get("camera_updates", 0) > 12, "cameras publish nothing")
        edge.send_signal(signal.SIGKILL)
        edge.wait()
        time.sleep(1.0)
        self.assertTrue((self.folder / "mapweave-store/cameras/north.mwj").exists())
        shutil.copytree(self.folder / "mapweave-store/cameras", self.folder / "left")
        edge = start_edge()
        self.wait_for(lambda: counts().get("camera_views", 0) > 4, "cameras do not come back")
        seen = counts()
        self.assertEqual((seen["cameras"], seen["camera_refused"]), (2, 0))
        self.assertIn("mapweave_camera_received_bytes_total", serve_test.ask(port, "/metrics")[1])
        for robot in robots:
            self.assertIn("its edge has all that it mapped", self.end(robot, seconds=300)[1])
        self.assertIn(cloud.wait(300 * support.PATIENCE), (support.DONE, support.APART))
        self.end(edge)
        self.assertFalse((self.folder / "mapweave-store").exists(), "what was received is in the results")
        live, run = self.cameras("live"), self.cameras("run")
        self.assertEqual([camera["frames"] for camera in live], [camera["frames"] for camera in run], "no frame is lost to the network")
        self.assertGreater(min(camera["sent_bytes"] for camera in live), 100000)
        self.assertGreater(sum(camera["heard_bytes"] for camera in live), 1000, "something was shared")
        print(f"{share}: {self.error('live'):.4f} m; of run {self.error('run'):.4f} m", flush=True)
        self.assertLess(self.error("live"), max(1.1 * self.error("run"), self.error("run") + 0.003))
        return live

    def test_landmarks_in_view_are_shared(self):
        self.share("view")
        # What the killed edge left is where another session begins.
        self.mapweave("slam", "logs/beta.rawlog", "--robot", "gamma", "--set", "sensor=rgbd", "--map", "left/north.mwj", "--out", "next",
                      code=(support.DONE, support.APART), seconds=300)
        compared = {name for pair in self.read_json("next/merges.json") for name in (pair["a"], pair["b"])}
        self.assertEqual({name.split(".")[0] for name in compared}, {"alpha", "beta", "gamma"})

    def test_the_global_map_is_shared(self):
        self.assertGreater(sum(camera["shared_keyframes"]["kept"] for camera in self.share("global") if "shared_keyframes" in camera), 0)

    def test_each_camera_of_a_robot_has_a_wire_of_its_own(self):
        small = "{kind: rgbd, width: 160, height: 120, fx: 131, fy: 131, frames_per_second: 8, "
        self.mapweave("simulate", self.write("world.yaml", "cameras:\n  - " + small + "id: front}\n  - " + small + "id: back, yaw_deg: 180, x_m: -0.15}\n"
                                             "robots:\n  - {id: alpha, edge: north, length_m: 4}\n"), "--out", "logs")
        talk = ["--set", "sensor=cameras", "--set", "server.share=full", "--set", f"live.broker={self.start_broker()}", "--set", f"live.speed={1.0 / support.PATIENCE}"]
        programs = [self.start("serve", *role, "logs/run.yaml", *talk) for role in (("cloud", "--out", "live"), ("edge",), ("robot",))]
        for process in programs:
            self.end(process)
        [robot] = self.read_json("live/summary.json")["robots"]
        self.assertEqual([camera["label"] for camera in robot["cameras"]], ["back", "front"])
        for camera in robot["cameras"]:
            self.assertGreater(camera["sent_bytes"], 10000, camera)
        self.assertNotIn("camera map server", json.dumps(self.read_json("live/summary.json")["notes"]))

    def test_what_is_not_done_is_said(self):
        self.mapweave("simulate", self.write("world.yaml", serve_test.WORLD), "--out", "logs")
        done = self.mapweave("serve", "edge", "logs/run.yaml", "--name", "north", "--set", "server.share=view", code=support.BAD_INPUT)
        self.assert_says(done, "within their edge alone", "server.across_edges", "across_edges: false")
        done = self.mapweave("serve", "edge", "logs/run.yaml", "--name", "north", "--set", "server.share=view", "--set", "coordinator.method=default", code=support.BAD_INPUT)
        self.assert_says(done, "coordinator", "share: none")


if __name__ == "__main__":
    support.main()
