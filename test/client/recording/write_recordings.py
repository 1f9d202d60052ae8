#!/usr/bin/env python3
"""Writes one small recording in every container, with independent writers.

    write_recordings.py PACKAGES FOLDER

PACKAGES has the packages of requirements.txt. FOLDER is replaced. The recording
has formulas for its pixels and readings, which containers_test.cc repeats.
"""

import pathlib
import shutil
import sys

sys.path.insert(0, sys.argv[1])

import numpy as np
from mcap.writer import CompressionType, IndexType, Writer as McapWriter
from PIL import Image
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

FOLDER = pathlib.Path(sys.argv[2])
WIDTH, HEIGHT = 48, 36
CAMERAS, IMAGES, READINGS = 2, 5, 40
BEGIN_NS = 1_500_000_000_123_456_789
IMAGE_NS, READING_NS = 50_000_000, 5_000_000
JPEG_QUALITY = 90

ROS1 = get_typestore(Stores.ROS1_NOETIC)
ROS2 = get_typestore(Stores.ROS2_HUMBLE)
IMAGE = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"
IMU = "sensor_msgs/msg/Imu"
INFO = "sensor_msgs/msg/CameraInfo"


def pixels(camera: int, image: int) -> np.ndarray:
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    values = 7 * u + 13 * v + (u * v) % 17 + 31 * image + 59 * camera
    return (values % 256).astype(np.uint8)


def image_ns(image: int) -> int:
    return BEGIN_NS + image * IMAGE_NS


def reading(i: int) -> tuple[int, list[float]]:
    return BEGIN_NS + i * READING_NS, [(10 * i + j) * 0.001 for j in range(6)]


def encoded(array: np.ndarray, kind: str) -> bytes:
    path = FOLDER / f"encoded.{kind}"
    options = {"quality": JPEG_QUALITY} if kind == "jpeg" else {}
    Image.fromarray(array).save(path, **options)
    data = path.read_bytes()
    path.unlink()
    return data


class Messages:
    """Messages of one version of ROS, as (topic, type, time, message)."""

    def __init__(self, store):
        self.store = store

    def make(self, name: str, **fields):
        return self.store.types[name](**fields)

    def header(self, t_ns: int):
        stamp = self.make(
            "builtin_interfaces/msg/Time",
            sec=t_ns // 10**9,
            nanosec=t_ns % 10**9,
        )
        more = {"seq": 7} if self.store is ROS1 else {}
        return self.make(
            "std_msgs/msg/Header", stamp=stamp, frame_id="optical", **more
        )

    def image(self, camera: int, k: int, kind: str):
        header = self.header(image_ns(k))
        array = pixels(camera, k)
        topic = f"/cam{camera}/image_raw"
        if kind == "raw":
            # Rows are longer than their pixels.
            padded = np.pad(array, ((0, 0), (0, 3)), constant_values=99)
            message = self.make(
                IMAGE,
                header=header,
                height=HEIGHT,
                width=WIDTH,
                encoding="mono8",
                is_bigendian=0,
                step=WIDTH + 3,
                data=padded.reshape(-1),
            )
            return topic, IMAGE, image_ns(k), message
        data = np.frombuffer(encoded(array, kind), dtype=np.uint8)
        message = self.make(
            COMPRESSED, header=header, format=f"mono8; {kind}", data=data
        )
        return f"{topic}/compressed", COMPRESSED, image_ns(k), message

    def imu(self, i: int, topic="/imu0"):
        t_ns, values = reading(i)
        vector, nine = "geometry_msgs/msg/Vector3", np.arange(9.0)
        message = self.make(
            IMU,
            header=self.header(t_ns),
            orientation=self.make(
                "geometry_msgs/msg/Quaternion", x=0.5, y=0.5, z=0.5, w=0.5
            ),
            orientation_covariance=nine,
            angular_velocity=self.make(
                vector, x=values[0], y=values[1], z=values[2]
            ),
            angular_velocity_covariance=nine,
            linear_acceleration=self.make(
                vector, x=values[3], y=values[4], z=values[5]
            ),
            linear_acceleration_covariance=nine,
        )
        return topic, IMU, t_ns, message

    def info(self, **changes):
        lower = {
            "k": np.array([40.5, 0, 23.5, 0, 41.5, 17.5, 0, 0, 1]),
            "d": np.array([-0.25, 0.0625, 0.001, 0.002, 0.0]),
            "r": np.eye(3).reshape(-1),
            "p": np.eye(3, 4).reshape(-1),
        }
        for key in list(lower):
            lower[key] = changes.pop(key, lower[key])
        matrices = (
            {key.upper(): value for key, value in lower.items()}
            if self.store is ROS1
            else lower
        )
        fields = {
            "header": self.header(BEGIN_NS),
            "height": HEIGHT,
            "width": WIDTH,
            "distortion_model": "plumb_bob",
            "binning_x": 0,
            "binning_y": 0,
            "roi": self.make(
                "sensor_msgs/msg/RegionOfInterest",
                x_offset=0,
                y_offset=0,
                height=0,
                width=0,
                do_rectify=False,
            ),
        }
        message = self.make(INFO, **(fields | matrices | changes))
        return "/cam0/camera_info", INFO, BEGIN_NS, message

    def images(self, kind="raw"):
        return [
            self.image(j, k, kind)
            for k in range(IMAGES)
            for j in range(CAMERAS)
        ]

    def readings(self, topic="/imu0"):
        return [self.imu(i, topic) for i in range(READINGS)]

    def all(self, kind="raw"):
        other = self.make("std_msgs/msg/String", data="nothing of interest")
        entries = [
            *self.images(kind),
            *self.readings(),
            self.info(),
            ("/chatter", "std_msgs/msg/String", BEGIN_NS, other),
        ]
        return sorted(entries, key=lambda entry: entry[2])

    def serialize(self, message, name: str, little_endian=True) -> bytes:
        if self.store is ROS1:
            return bytes(self.store.serialize_ros1(message, name))
        return bytes(
            self.store.serialize_cdr(message, name, little_endian=little_endian)
        )


def write_ros1(name: str, compression, entries) -> None:
    messages = Messages(ROS1)
    writer = rosbag1.Writer(FOLDER / name)
    writer.chunk_threshold = 8192
    if compression:
        writer.set_compression(compression)
    with writer:
        connections = {}
        for topic, kind, t_ns, message in entries:
            if topic not in connections:
                connections[topic] = writer.add_connection(
                    topic, kind, typestore=ROS1
                )
            data = messages.serialize(message, kind)
            writer.write(connections[topic], t_ns, data)


def write_ros2(name: str, plugin, mode=None) -> None:
    messages = Messages(ROS2)
    writer = rosbag2.Writer(FOLDER / name, version=9, storage_plugin=plugin)
    if mode:
        writer.set_compression(mode, rosbag2.CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for topic, kind, t_ns, message in messages.all():
            if topic not in connections:
                connections[topic] = writer.add_connection(
                    topic, kind, typestore=ROS2
                )
            data = messages.serialize(message, kind)
            writer.write(connections[topic], t_ns, data)


def write_mcap(name: str, entries, store=ROS2, little_endian=True, **options):
    messages = Messages(store)
    options = {"chunk_size": 8192} | options
    with open(FOLDER / name, "wb") as file:
        writer = McapWriter(file, **options)
        writer.start(profile="ros1" if store is ROS1 else "ros2")
        channels = {}
        for topic, kind, t_ns, message in entries:
            if topic not in channels:
                ros1 = store is ROS1
                text, _ = store.generate_msgdef(kind)
                schema = writer.register_schema(
                    kind.replace("/msg/", "/") if ros1 else kind,
                    "ros1msg" if ros1 else "ros2msg",
                    text.encode(),
                )
                channels[topic] = writer.register_channel(
                    topic, "ros1" if ros1 else "cdr", schema
                )
            data = messages.serialize(message, kind, little_endian)
            writer.add_message(channels[topic], t_ns, data, t_ns)
        writer.finish()


def write_folders() -> None:
    """EuRoC's, TUM-VI's (16 bits, names without .png) and CSV's."""
    imu = ["#timestamp [ns],w x,w y,w z,a x,a y,a z"]
    for i in range(READINGS):
        t_ns, values = reading(i)
        imu.append(",".join([str(t_ns), *(repr(value) for value in values)]))
    heading = imu[0].removeprefix("#")
    for name in ("euroc", "tum_vi", "csv"):
        is_csv = name == "csv"
        root = FOLDER / name
        for j in range(CAMERAS):
            lines = ["#timestamp [ns],filename"]
            folder = root / (f"cam{j}" if is_csv else f"mav0/cam{j}/data")
            folder.mkdir(parents=True)
            for k in range(IMAGES):
                array = pixels(j, k)
                if name == "tum_vi":
                    array = array.astype(np.uint16) * 257
                Image.fromarray(array).save(folder / f"{image_ns(k)}.png")
                file = {
                    "euroc": f"{image_ns(k)}.png",
                    "tum_vi": f"{image_ns(k)}",
                    "csv": f"cam{j}/{image_ns(k)}.png",
                }[name]
                lines.append(f"{image_ns(k)},{file}")
            path = root / f"cam{j}.csv" if is_csv else folder / "../data.csv"
            path.write_text("\n".join(lines) + "\n")
        if is_csv:
            (root / "imu.csv").write_text("\n".join([heading, *imu[1:]]))
        else:
            (root / "mav0/imu0").mkdir()
            (root / "mav0/imu0/data.csv").write_text("\r\n".join(imu) + "\r\n")


def write_bags() -> None:
    ros1, ros2 = Messages(ROS1), Messages(ROS2)
    write_ros1("ros1_none.bag", None, ros1.all())
    formats = rosbag1.Writer.CompressionFormat
    write_ros1("ros1_lz4.bag", formats.LZ4, ros1.all())
    write_ros1("ros1_bz2.bag", formats.BZ2, ros1.all())
    write_ros1("ros1_png.bag", None, ros1.all("png"))
    modes = rosbag2.CompressionMode
    sqlite, mcap = rosbag2.StoragePlugin.SQLITE3, rosbag2.StoragePlugin.MCAP
    write_ros2("ros2_sqlite", sqlite)
    write_ros2("ros2_mcap", mcap)
    write_ros2("ros2_mcap_zstd", mcap, modes.STORAGE)
    write_ros2("ros2_file_zstd", sqlite, modes.FILE)
    write_ros2("ros2_message_zstd", sqlite, modes.MESSAGE)
    write_mcap("none.mcap", ros2.all(), compression=CompressionType.NONE)
    write_mcap("lz4.mcap", ros2.all(), compression=CompressionType.LZ4)
    write_mcap("zstd.mcap", ros2.all())
    write_mcap("no_chunks.mcap", ros2.all(), use_chunking=False)
    write_mcap(
        "no_index.mcap",
        ros2.all(),
        index_types=IndexType.NONE,
        repeat_channels=False,
        repeat_schemas=False,
        use_statistics=False,
        use_summary_offsets=False,
    )
    write_mcap("big_endian.mcap", ros2.all(), little_endian=False)
    write_mcap("ros1.mcap", ros1.all(), store=ROS1)
    write_mcap("png.mcap", ros2.all("png"))


def write_special_bags() -> None:
    """Bags that are not the same recording."""
    ros1, ros2 = Messages(ROS1), Messages(ROS2)
    write_mcap("jpeg.mcap", [*ros2.images("jpeg"), *ros2.readings()])
    write_mcap(
        "raw_and_png.mcap",
        [*ros2.images(), *ros2.images("png"), *ros2.readings()],
    )
    write_mcap(
        "two_imus.mcap",
        [*ros2.images(), *ros2.readings(), *ros2.readings("/imu1")],
    )
    write_mcap("no_imu.mcap", ros2.images())
    write_mcap("no_images.mcap", ros2.readings())
    images, readings = ros1.images(), ros1.readings()
    images[2], images[4] = images[4], images[2]
    readings[7], readings[9] = readings[9], readings[7]
    write_ros1(
        "disorder.bag", None, [*images, images[6], *readings, readings[3]]
    )
    for name, changes in {
        "uncalibrated": {"k": np.zeros(9)},
        "binned": {"binning_x": 2},
        "unknown_model": {"distortion_model": "brown_2"},
        "equidistant": {
            "distortion_model": "equidistant",
            "d": np.array([0.1, 0.02, 0.003, 0.0004]),
        },
    }.items():
        write_mcap(
            f"{name}.mcap",
            [ros2.info(**changes), *ros2.images(), *ros2.readings()],
        )


def write_jpeg_truth() -> None:
    """What another program makes of the images of jpeg.mcap."""
    for j in range(CAMERAS):
        for k in range(IMAGES):
            path = FOLDER / "image.jpeg"
            path.write_bytes(encoded(pixels(j, k), "jpeg"))
            decoded = np.asarray(Image.open(path))
            path.unlink()
            (FOLDER / f"jpeg_{j}_{k}.raw").write_bytes(decoded.tobytes())


def main() -> None:
    shutil.rmtree(FOLDER, ignore_errors=True)
    FOLDER.mkdir(parents=True)
    write_folders()
    write_bags()
    write_special_bags()
    write_jpeg_truth()


main()
