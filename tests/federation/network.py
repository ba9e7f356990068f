"""Two hosts with addresses of their own, made of network namespaces, between which every packet takes 50 ms and one in
twenty is lost. By netem where the kernel has it; else by a process that stands between two tun devices."""

import ctypes
import fcntl
import heapq
import os
import pathlib
import random
import select
import struct
import subprocess
import sys
import time

DELAY_S, LOSS = 0.05, 0.05
# TUNSETIFF; IFF_TUN without the header of the kernel's own.
TUNSETIFF, IFF_TUN_NO_PI = 0x400454CA, 0x1001
CLONE_NEWNET = 0x40000000


def obstacle():
    """Why there are no such hosts here, if so."""
    if os.geteuid() != 0:
        return "network namespaces need root"
    probe = f"bess{os.getpid()}p"
    try:
        subprocess.run(["ip", "netns", "add", probe], check=True, capture_output=True, text=True)
        subprocess.run(["ip", "netns", "del", probe], check=True, capture_output=True, text=True)
    except FileNotFoundError:
        return "ip is missing: apt-get install iproute2"
    except subprocess.CalledProcessError as error:
        return f"ip netns: {error.stderr.strip()}"
    return None


class Hosts:
    """`a` and `b`: names of the namespaces; `address_a`, `address_b`. To be used in a with statement."""

    def __init__(self):
        self.a, self.b = (f"bess{os.getpid()}{letter}" for letter in "ab")
        self.address_a, self.address_b = "10.77.0.1", "10.77.0.2"
        self.relay = None
        self.how = ""

    def prefix(self, host):
        """What a command is started with to be on this host."""
        return ("ip", "netns", "exec", host)

    def __enter__(self):
        try:
            for host in (self.a, self.b):
                ip("netns", "add", host)
                ip("-n", host, "link", "set", "lo", "up")
            if not self.by_netem():
                self.by_relay()
        except BaseException:
            self.__exit__()
            raise
        return self

    def by_netem(self):
        ip("link", "add", "v0", "netns", self.a, "type", "veth", "peer", "name", "v0", "netns", self.b)
        for host, address in ((self.a, self.address_a), (self.b, self.address_b)):
            ip("-n", host, "addr", "add", f"{address}/24", "dev", "v0")
            ip("-n", host, "link", "set", "v0", "up")
        for host in (self.a, self.b):
            rule = ["delay", f"{DELAY_S * 1000:.0f}ms", "loss", f"{LOSS * 100:.0f}%"]
            netem = ["tc", "-n", host, "qdisc", "add", "dev", "v0", "root", "netem", *rule]
            if subprocess.run(netem, capture_output=True).returncode != 0:
                ip("-n", self.a, "link", "del", "v0")
                return False
        self.how = "netem"
        return True

    def by_relay(self):
        command = [sys.executable, str(pathlib.Path(__file__)), self.a, self.b]
        self.relay = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self.relay.stdout.readline() == "ready\n"
        ends = ((self.a, self.address_a, self.address_b), (self.b, self.address_b, self.address_a))
        for host, own, other in ends:
            ip("-n", host, "addr", "add", own, "peer", other, "dev", "t0")
            ip("-n", host, "link", "set", "t0", "up")
        self.how = "a relay between tun devices (this kernel has no netem)"

    def __exit__(self, *_):
        if self.relay:
            self.relay.stdin.close()
            self.relay.wait(10)
            self.relay.stdout.close()
        for host in (self.a, self.b):
            subprocess.run(["ip", "netns", "del", host], capture_output=True)


def ip(*words):
    done = subprocess.run(["ip", *words], capture_output=True, text=True)
    assert done.returncode == 0, f"ip {' '.join(words)}: {done.stderr}"


def tun(host):
    """A tun device in this namespace, held from outside of it."""
    libc = ctypes.CDLL(None, use_errno=True)
    home = os.open("/proc/self/ns/net", os.O_RDONLY)
    there = os.open(f"/run/netns/{host}", os.O_RDONLY)
    assert libc.setns(there, CLONE_NEWNET) == 0, os.strerror(ctypes.get_errno())
    device = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(device, TUNSETIFF, struct.pack("16sH14x", b"t0", IFF_TUN_NO_PI))
    assert libc.setns(home, CLONE_NEWNET) == 0, os.strerror(ctypes.get_errno())
    os.close(home)
    os.close(there)
    return device


def relay(a, b):
    """Carries packets between the two, late and not all of them, until standard input is closed."""
    first, second = tun(a), tun(b)
    other = {first: second, second: first}
    chance, late, count = random.Random(1), [], 0
    print("ready", flush=True)
    while True:
        patience = max(0.0, late[0][0] - time.monotonic()) if late else 1.0
        ready, _, _ = select.select([first, second, 0], [], [], patience)
        if 0 in ready:
            return
        now = time.monotonic()
        for device in ready:
            try:
                packet = os.read(device, 65536)
            except OSError:
                continue
            count += 1
            if chance.random() >= LOSS:
                heapq.heappush(late, (now + DELAY_S, count, other[device], packet))
        while late and late[0][0] <= now:
            _, _, device, packet = heapq.heappop(late)
            try:
                os.write(device, packet)
            except OSError:
                pass


if __name__ == "__main__":
    relay(*sys.argv[1:])
