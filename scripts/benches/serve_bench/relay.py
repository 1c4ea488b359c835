"""A wire that can be bad: what robots send to the broker, and what it answers, goes through here."""
import random
import socket
import threading
import time

PIECE = 4096   # bytes that are delayed together
RESEND_S = 0.25   # after which TCP sends a lost piece again, at first


class Relay:
    """Listens on `port` for connections to a port of this machine. bytes_per_s: of each direction of a connection; 0: without limit. lost: share of pieces that come later, as TCP sends them again."""

    def __init__(self, port, to, delay_s=0.0, bytes_per_s=0.0, lost=0.0, seed=1):
        self.to, self.delay_s, self.bytes_per_s, self.lost, self.chance = to, delay_s, bytes_per_s, lost, random.Random(seed)
        self.is_whole = threading.Event()
        self.is_whole.set()
        self.listener = socket.create_server(("127.0.0.1", port))
        threading.Thread(target=self.accept, daemon=True).start()

    def cut(self):
        """Nothing comes through, and nobody is told: as where a radio is out of reach."""
        self.is_whole.clear()

    def mend(self):
        self.is_whole.set()

    def close(self):
        self.mend()
        self.listener.close()

    def accept(self):
        while True:
            try:
                near, _ = self.listener.accept()
                far = socket.create_connection(("127.0.0.1", self.to), timeout=10)
                far.settimeout(None)
            except OSError:
                if self.listener.fileno() < 0:
                    return
                continue
            for source, sink in ((near, far), (far, near)):
                queue = []
                threading.Thread(target=self.read, args=(source, queue), daemon=True).start()
                threading.Thread(target=self.write, args=(sink, source, queue), daemon=True).start()

    def read(self, source, queue):
        """Pieces with the time at which they arrive. What is in flight is bounded, as a socket's buffer is."""
        last = 0.0
        while True:
            while len(queue) > 64:
                time.sleep(0.005)
            try:
                piece = source.recv(PIECE)
            except OSError:
                piece = b""
            arrives = time.time() + self.delay_s / 2
            wait_s = RESEND_S
            while piece and self.chance.random() < self.lost:
                arrives += wait_s
                wait_s *= 2
            last = max(last, arrives)   # in order
            queue.append((last, piece))
            if not piece:
                return

    def write(self, sink, source, queue):
        free_at = 0.0
        while True:
            if not queue:
                time.sleep(0.002)
                continue
            at, piece = queue[0]
            time.sleep(max(0.0, at - time.time()))
            self.is_whole.wait()
            queue.pop(0)
            try:
                if not piece:
                    sink.shutdown(socket.SHUT_WR)
                    return
                if self.bytes_per_s:
                    free_at = max(free_at, time.time()) + len(piece) / self.bytes_per_s
                    time.sleep(max(0.0, free_at - time.time()))
                sink.sendall(piece)
            except OSError:
                source.close()
                return
