"""What arrives over a broker and should not: strangers, and halves of messages; and streams that somebody deletes."""
import json
import socket
import subprocess
import time

import serve_test
import support

WORLD = """\
laser: {rays: 91, scans_per_second: 2.0}
robots:
  - {id: alpha, edge: north, length_m: 12, first_room: 0}
  - {id: beta, edge: north, length_m: 12, first_room: 1}
"""


class Stranger:
    """Some other program at the broker, by the protocol of NATS itself."""

    def __init__(self, url):
        host, port = url.rsplit("/", 1)[1].split(":")
        self.socket = socket.create_connection((host, int(port)), timeout=10)
        self.lines = self.socket.makefile("rb")
        self.lines.readline()
        self.send(b'CONNECT {"verbose":false,"echo":false}\r\n')

    def send(self, data):
        self.socket.sendall(data)

    def publish(self, subject, payload, reply=""):
        self.send(f"PUB {subject} {reply + ' ' if reply else ''}{len(payload)}\r\n".encode() + payload + b"\r\n")

    def subscribe(self, subject):
        self.send(f"SUB {subject} 1\r\n".encode())

    def messages(self):
        """(subject, payload) of what comes, without end."""
        while line := self.lines.readline():
            if line.startswith(b"PING"):
                self.send(b"PONG\r\n")
            if not line.startswith((b"MSG", b"HMSG")):
                continue
            words = line.decode().split()
            payload = self.lines.read(int(words[-1]) + 2)[:-2]
            yield words[1], payload

    def ask(self, subject):
        """The broker's answer to a request without content."""
        self.subscribe("_INBOX.stranger")
        self.publish(subject, b"", "_INBOX.stranger")
        return json.loads(next(self.messages())[1])

    def close(self):
        self.socket.close()


class OfTwoRobots(serve_test.WithBroker):
    """What tests of a deployment with one edge share."""
    speed = 2

    def begin(self, broker):
        """A deployment on its way: its processes by name, and what its edge's page says."""
        self.mapweave("simulate", self.write("world.yaml", WORLD), "--out", "logs")
        self.mapweave("run", "logs/run.yaml", "--out", "run")
        self.port = serve_test.free_port()
        self.talk = ["--set", f"live.broker={broker}", "--set", f"live.speed={self.speed}"]
        return {"cloud": self.start("serve", "cloud", "logs/run.yaml", "--out", "live", *self.talk),
                "north": self.start("serve", "edge", "logs/run.yaml", "--name", "north", "--set", f"live.page_port={self.port}", *self.talk),
                "alpha": self.start("serve", "robot", "logs/run.yaml", "--name", "alpha", *self.talk),
                "beta": self.start("serve", "robot", "logs/run.yaml", "--name", "beta", *self.talk)}

    def end_all(self, programs):
        for program in programs.values():
            self.end(program)
        self.assert_same_map("live", "run")


class Broker(OfTwoRobots):
    def test_a_broker_without_jetstream_is_refused_with_what_helps(self):
        port = serve_test.free_port()
        broker = subprocess.Popen([serve_test.BROKER, "-a", "127.0.0.1", "-p", str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(broker.wait)
        self.addCleanup(broker.kill)
        self.write("run.yaml", "robots: [{id: alpha, edge: north, log: a.rawlog}]\nedges: [{id: north}]\n")
        for verb in (["doctor", "run.yaml"], ["serve", "edge", "run.yaml"], ["serve", "cloud", "run.yaml", "--out", "live"]):
            refused = self.mapweave(*verb, "--set", f"live.broker=nats://127.0.0.1:{port}", code=support.BAD_INPUT)
            self.assertIn("start nats-server with -js", refused.stderr)

    def test_bytes_of_strangers_and_halves_of_messages_change_nothing(self):
        broker = self.start_broker()
        programs = self.begin(broker)
        stranger = Stranger(broker)
        self.addCleanup(stranger.close)
        sent = 0
        stranger.subscribe("mw.>")
        for subject, payload in stranger.messages():
            stranger.publish(subject, b"some other program's bytes")
            stranger.publish(subject, payload[:len(payload) // 2])
            sent += 1
            if sent == 40:
                break
        self.wait_for(lambda: "parts that came are no messages" in serve_test.findings(self.port), "the edge's page tells of them")
        self.assertRegex(serve_test.ask(self.port, "/metrics")[1], r'mapweave_link_wire_refused_total\{[^}]*peer="(alpha|beta|cloud)"\} [1-9]')
        self.end_all(programs)

    def test_streams_that_are_deleted_are_made_again(self):
        broker = self.start_broker()
        programs = self.begin(broker)
        self.wait_for(lambda: serve_test.findings(self.port), "the edge begins")
        time.sleep(1.0)
        stranger = Stranger(broker)
        self.addCleanup(stranger.close)
        names = stranger.ask("$JS.API.STREAM.NAMES")["streams"]
        for name in names:
            stranger.publish(f"$JS.API.STREAM.DELETE.{name}", b"", "_INBOX.nobody")
        self.end_all(programs)


if __name__ == "__main__":
    support.main()
