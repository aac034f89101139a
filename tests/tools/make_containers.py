#!/usr/bin/env python3
"""Writes tests/data/containers: one film in every container that kinoise reads.

The writers are not kinoise's: rosbags (ROS 1 bags, db3), mcap with mcap-ros2-support (MCAP), NumPy.
The film is whole-number arithmetic, so that tests/product/containers.rs makes the same one.

    python -m venv venv && venv/bin/pip install rosbags mcap mcap-ros2-support numpy
    venv/bin/python tests/tools/make_containers.py
"""

import shutil
import struct
import zlib
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from mcap_ros2.writer import Writer as McapRos2Writer
from rosbags.rosbag1 import Writer as Bag1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Bag2
from rosbags.typesys import Stores, get_typestore

WHERE = Path(__file__).parent.parent / "data" / "containers"
WIDTH, HEIGHT, STILL = 32, 24, 10
FX, FY, CX, CY = 29.0, 29.25, 15.5, 11.75
D = [0.02, -0.03, 0.001, -0.002, 0.004]
START_NS, STEP_NS = 1_305_031_102_175_304_000, 33_333_000
# mm on the axis; change of 1e9/mm a column and a row
VIEWS = [(800, 0, 0), (1200, 6000, -2000), (1700, -5000, 3000), (2300, 3000, 0)]


def film():
    """uint16 frames, mm."""
    state = 12345
    for mm, du, dv in VIEWS:
        for _ in range(STILL):
            frame = np.zeros((HEIGHT, WIDTH), np.uint16)
            for v in range(HEIGHT):
                for u in range(WIDTH):
                    total = 0
                    for _ in range(4):
                        state = (state * 1103515245 + 12345) % (1 << 31)
                        total += (state >> 16) & 0xFF
                    z = 1_000_000_000 // (1_000_000_000 // mm + du * (u - 16) + dv * (v - 12))
                    frame[v, u] = 0 if (state >> 8) % 97 == 0 else z + (total - 510) * z * z // 98_500_000
            yield frame


def stamp_ns(k):
    return START_NS + k * STEP_NS


class Messages:
    """The messages of one generation of ROS, serialised."""

    def __init__(self, ros1):
        self.ros1 = ros1
        self.store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        self.types = self.store.types

    def bytes(self, kind, message):
        serialise = self.store.serialize_ros1 if self.ros1 else self.store.serialize_cdr
        return bytes(serialise(message, kind))

    def header(self, ns, frame="optical"):
        time = self.types["builtin_interfaces/msg/Time"](int(ns // 10**9), int(ns % 10**9))
        header = self.types["std_msgs/msg/Header"]
        return header(0, time, frame) if self.ros1 else header(time, frame)

    def image(self, ns, frame, encoding="16UC1", big=0, frame_id="optical", pad=0):
        height, width = frame.shape
        raw = frame.astype(frame.dtype.newbyteorder(">" if big else "<")).tobytes()
        row = width * frame.dtype.itemsize
        raw = b"".join(raw[v * row : (v + 1) * row] + b"\xee" * pad for v in range(height))
        kind = "sensor_msgs/msg/Image"
        data = np.frombuffer(raw, np.uint8)
        head = self.header(ns, frame_id)
        return kind, self.types[kind](head, height, width, encoding, big, row + pad, data)

    def compressed(self, ns, format, data):
        kind = "sensor_msgs/msg/CompressedImage"
        return kind, self.types[kind](self.header(ns), format, np.frombuffer(data, np.uint8))

    def info(self, ns, d, model="plumb_bob", width=WIDTH, height=HEIGHT):
        kind = "sensor_msgs/msg/CameraInfo"
        roi = self.types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
        k = np.array([FX, 0, CX, 0, FY, CY, 0, 0, 1.0])
        p = np.array([FX, 0, CX, 0, 0, FY, CY, 0, 0, 0, 1, 0.0])
        r = np.eye(3).ravel()
        fields = (self.header(ns), height, width, model, np.array(d, float), k, r, p, 0, 0, roi)
        return kind, self.types[kind](*fields)

    def temperature(self, ns, celsius):
        kind = "sensor_msgs/msg/Temperature"
        return kind, self.types[kind](self.header(ns), celsius, 0.0)

    def float32(self, value):
        return "std_msgs/msg/Float32", self.types["std_msgs/msg/Float32"](value)

    def key_value(self, key, value):
        kind = "diagnostic_msgs/msg/KeyValue"
        return kind, self.types[kind](key, value)


def write_bag(writer, messages, film):
    """(topic, ns, (kind, message or bytes)) in order."""
    connections = {}
    with writer:
        for topic, ns, (kind, message) in film:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=messages.store)
            raw = message if isinstance(message, bytes) else messages.bytes(kind, message)
            writer.write(connections[topic], ns, raw)


def write_mcap(path, film, chunking=True, described=True, **options):
    """ROS 2 messages through the format's own library; `described` with the text of their types."""
    messages = Messages(False)
    with path.open("wb") as stream:
        writer = McapWriter(stream, use_chunking=chunking, **options)
        writer.start(profile="ros2", library="kinoise test data")
        channels = {}
        for topic, ns, (kind, message) in film:
            if topic not in channels:
                text = messages.store.generate_msgdef(kind, ros_version=2)[0] if described else ""
                schema = writer.register_schema(kind, "ros2msg", text.encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], ns, messages.bytes(kind, message), ns)
        writer.finish()


def whole_film(m, frames):
    """A camera as ROS drivers publish it, and others of its topics."""
    yield "/camera/depth/camera_info", stamp_ns(0), m.info(stamp_ns(0), D)
    yield "/camera/rgb/camera_info", stamp_ns(0), m.info(stamp_ns(0), [], width=8, height=6)
    for k, frame in enumerate(frames):
        ns = stamp_ns(k)
        # Written some time after it was taken.
        yield "/camera/depth/image_raw", ns + 5_000_000, m.image(ns, frame)
        if k % STILL == 4:
            colour = np.full((6, 8 * 3), 77, np.uint8)
            kind, rgb = m.image(ns, colour, "rgb8")
            rgb.width = 8
            yield "/camera/rgb/image_color", ns + 6_000_000, (kind, rgb)
            yield "/camera/temperature", ns + 7_000_000, m.temperature(ns, 30.0 + k / STILL)


def png(frame):
    """A 16-bit grey PNG."""
    height, width = frame.shape
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in frame)

    def chunk(name, data):
        body = name + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    head = struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")


# depth = A / (word - B), as compressed_depth_image_transport quantises with its defaults (100, 10 m)
QUANT_A = 100.0 * 101.0
QUANT_B = 1.0 - QUANT_A / 10.0


def kinds(m, frames):
    """Every way of writing depth, each in a namespace of its own; the film's first frames each."""
    for name in ("big", "metres", "metres_big", "padded", "png", "inverse"):
        yield f"/{name}/camera_info", stamp_ns(0), m.info(stamp_ns(0), [])
    for k, frame in enumerate(frames):
        ns = stamp_ns(k)
        metres = np.where(frame > 0, frame / np.float32(1000), np.nan).astype(np.float32)
        inverse = np.where(frame > 0, QUANT_A / np.maximum(metres, 1e-3) + QUANT_B, 0)
        header = struct.pack("<iff", 1, QUANT_A, QUANT_B)
        yield "/big/image", ns, m.image(ns, frame, big=1)
        yield "/metres/image", ns, m.image(ns, metres, "32FC1")
        yield "/metres_big/image", ns, m.image(ns, metres, "32FC1", big=1)
        yield "/padded/image", ns, m.image(ns, frame, pad=6)
        yield "/png/image/compressedDepth", ns, m.compressed(ns, "16UC1; compressedDepth", bytes(12) + png(frame))
        words = np.nan_to_num(inverse).astype(np.uint16)
        data = header + png(words)
        yield "/inverse/image/compressedDepth", ns, m.compressed(ns, "32FC1; compressedDepth png", data)


def realsense(m, frames, unit_behind):
    """As librealsense's recorder writes: names, the unit of a word, ns since the start."""
    sensor = "/device_0/sensor_0"
    yield "/device_0/info", 1, m.key_value("Name", "Intel RealSense D435")
    yield "/device_0/info", 1, m.key_value("Serial Number", "0123456789")
    yield f"{sensor}/option/Depth Units/value", 1, m.float32(0.0001)
    yield f"{sensor}/option/Stereo Baseline/value", 1, m.float32(49.94)
    yield f"{sensor}/Depth_0/info/camera_info", 1, m.info(1, [0.0] * 5, "Brown Conrady")
    yield f"{sensor}/Infrared_1/info/camera_info", 1, m.info(1, [0.0] * 5, "Brown Conrady")
    for k, frame in enumerate(frames[:2]):
        kind, image = m.image(stamp_ns(k), frame, "mono16", frame_id="1" if unit_behind else "")
        raw = m.bytes(kind, image) + (struct.pack("<f", 0.001) if unit_behind else b"")
        yield f"{sensor}/Depth_0/image/data", 2 + k, (kind, raw)
        yield f"{sensor}/Infrared_1/image/data", 2 + k, m.image(stamp_ns(k), frame, "16UC1")


def main():
    shutil.rmtree(WHERE, ignore_errors=True)
    WHERE.mkdir(parents=True)
    frames = list(film())
    ros1, ros2 = Messages(True), Messages(False)

    def bag1(name, compression, messages):
        writer = Bag1(WHERE / name)
        if compression:
            writer.set_compression(compression)
        write_bag(writer, ros1, messages)

    formats = Bag1.CompressionFormat
    bag1("film.bag", formats.BZ2, whole_film(ros1, frames))
    bag1("kinds.bag", formats.LZ4, kinds(ros1, frames[:2]))
    bag1("realsense.bag", None, realsense(ros1, frames, True))
    bag1("realsense-older.bag", formats.LZ4, realsense(ros1, frames, False))
    bag1("no-depth.bag", None, [("/imu/temperature", 1, ros1.temperature(1, 20.0))])

    write_mcap(WHERE / "film.mcap", whole_film(ros2, frames), chunk_size=40_000)
    write_mcap(WHERE / "kinds.mcap", kinds(ros2, frames[:1]), described=False, compression=CompressionType.LZ4)
    few = [m for m in kinds(ros2, frames[:1]) if m[0].startswith("/big/")]
    write_mcap(WHERE / "unchunked.mcap", few, chunking=False, described=False)
    write_mcap(
        WHERE / "unindexed.mcap",
        few,
        described=False,
        compression=CompressionType.NONE,
        index_types=IndexType.NONE,
        repeat_channels=False,
        repeat_schemas=False,
    )
    writer = Bag2(WHERE / "film", version=9, storage_plugin=StoragePlugin.SQLITE3)
    writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    write_bag(writer, ros2, whole_film(ros2, frames))

    film_mm = np.stack(frames)
    np.savez_compressed(
        WHERE / "film.npz",
        depth=film_mm,
        K=np.array([[FX, 0, CX], [0, FY, CY], [0, 0, 1]]),
        D=np.array(D),
        timestamps=np.array([float(f"{stamp_ns(k) // 10**9}.{stamp_ns(k) % 10**9:09}") for k in range(len(frames))]),
        units_per_metre=1000.0,
    )
    np.save(WHERE / "words.npy", film_mm[:2])
    np.save(WHERE / "metres.npy", (film_mm[:2] / 1000.0).astype(">f4"))
    np.savez(WHERE / "two.npz", near=film_mm[:1], far=film_mm[-1:])
    for path in sorted(WHERE.rglob("*")):
        print(f"{path.stat().st_size:8} {path.relative_to(WHERE)}")


if __name__ == "__main__":
    main()
