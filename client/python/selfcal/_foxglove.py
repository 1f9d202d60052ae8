"""Converts parts of a segment to Foxglove's schemas; see selfcal.mcap."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator

from foxglove_schemas_protobuf import (
    CameraCalibration_pb2,
    FrameTransform_pb2,
    ImageAnnotations_pb2,
    KeyValuePair_pb2,
    PackedElementField_pb2,
    Point2_pb2,
    PointCloud_pb2,
    PointsAnnotation_pb2,
    PoseInFrame_pb2,
    Quaternion_pb2,
    Vector3_pb2,
)
from google.protobuf import timestamp_pb2

from selfcal import mcap_messages_pb2 as messages
from selfcal.v1 import calibration_pb2 as v1, segment_pb2

Timed = tuple[int, str, object]  # t_ns, topic, message

# The models that Foxglove's schema knows.
_DISTORTION = {
    v1.DISTORTION_MODEL_RADIAL_TANGENTIAL: "plumb_bob",
    v1.DISTORTION_MODEL_RADIAL_TANGENTIAL_5: "plumb_bob",
    v1.DISTORTION_MODEL_RADIAL_TANGENTIAL_8: "rational_polynomial",
    v1.DISTORTION_MODEL_EQUIDISTANT: "kannala_brandt",
}


def _model_name(camera: v1.CameraCalibration) -> str:
    """Foxglove's name of a model, or selfcal's."""
    name = v1.DistortionModel.Name(camera.distortion_model)
    own = name.removeprefix("DISTORTION_MODEL_").lower()
    return _DISTORTION.get(camera.distortion_model, own)


def _stamp(t_ns: int) -> timestamp_pb2.Timestamp:
    return timestamp_pb2.Timestamp(seconds=t_ns // 10**9, nanos=t_ns % 10**9)


def _triples(values: Iterable[float]) -> Iterator[tuple[float, float, float]]:
    return zip(*[iter(values)] * 3)


def _contract_vector(xyz: tuple[float, float, float]) -> v1.Vector3:
    return v1.Vector3(x=xyz[0], y=xyz[1], z=xyz[2])


def _inverse(
    q: v1.Quaternion, p: v1.Vector3
) -> tuple[Quaternion_pb2.Quaternion, Vector3_pb2.Vector3]:
    """Returns T_BA for T_AB = (q, p)."""
    w, x, y, z = q.w, -q.x, -q.y, -q.z
    # -q^-1 p: twice the cross products of Rodrigues' formula.
    cross = (y * p.z - z * p.y, z * p.x - x * p.z, x * p.y - y * p.x)
    again = (
        y * cross[2] - z * cross[1],
        z * cross[0] - x * cross[2],
        x * cross[1] - y * cross[0],
    )
    rotated = [
        a + 2 * (w * b + c) for a, b, c in zip((p.x, p.y, p.z), cross, again)
    ]
    return (
        Quaternion_pb2.Quaternion(w=w, x=x, y=y, z=z),
        Vector3_pb2.Vector3(x=-rotated[0], y=-rotated[1], z=-rotated[2]),
    )


def sensors(
    calibration: v1.CalibrationParameters, t_ns: int
) -> Iterator[Timed]:
    """Yields the poses of the sensors and the intrinsics of the cameras."""
    parts = [("I", "A", calibration.imu.q_ai, v1.Vector3())]
    for number, camera in enumerate(calibration.cameras):
        parts.append(("I", f"cam{number}", camera.q_ci, camera.p_ci))
    if calibration.HasField("imu1"):
        second = calibration.imu1
        parts.append(("I", "J", second.q_ji, second.p_ji))
        parts.append(("J", "A1", second.q_ai, v1.Vector3()))
    for parent, frame, q, p in parts:
        rotation, translation = _inverse(q, p)
        yield (
            t_ns,
            "/tf",
            FrameTransform_pb2.FrameTransform(
                timestamp=_stamp(t_ns),
                parent_frame_id=parent,
                child_frame_id=frame,
                rotation=rotation,
                translation=translation,
            ),
        )
    for number, camera in enumerate(calibration.cameras):
        f, c = camera.f, camera.c
        coefficients = list(camera.distortion)
        if camera.distortion_model == v1.DISTORTION_MODEL_RADIAL_TANGENTIAL:
            coefficients.append(0.0)  # k3
        message = CameraCalibration_pb2.CameraCalibration(
            timestamp=_stamp(t_ns),
            frame_id=f"cam{number}",
            width=camera.width_px,
            height=camera.height_px,
            distortion_model=_model_name(camera),
            D=coefficients,
            K=[f.x, 0, c.x, 0, f.y, c.y, 0, 0, 1],
            R=[1, 0, 0, 0, 1, 0, 0, 0, 1],
            P=[f.x, 0, c.x, 0, 0, f.y, c.y, 0, 0, 0, 1, 0],
        )
        yield t_ns, f"/cam{number}/calibration", message


def keyframes(
    keyframes: segment_pb2.MotionSegment.Keyframes,
) -> Iterator[Timed]:
    columns = zip(
        keyframes.t_ns,
        zip(*[iter(keyframes.q_gi)] * 4),
        _triples(keyframes.p_gi),
        _triples(keyframes.v_gi),
        _triples(keyframes.b_a),
        _triples(keyframes.b_g),
    )
    for t_ns, (w, x, y, z), p, v, b_a, b_g in columns:
        rotation = Quaternion_pb2.Quaternion(w=w, x=x, y=y, z=z)
        place = Vector3_pb2.Vector3(x=p[0], y=p[1], z=p[2])
        yield (
            t_ns,
            "/tf",
            FrameTransform_pb2.FrameTransform(
                timestamp=_stamp(t_ns),
                parent_frame_id="G",
                child_frame_id="I",
                rotation=rotation,
                translation=place,
            ),
        )
        pose = PoseInFrame_pb2.PoseInFrame(timestamp=_stamp(t_ns), frame_id="G")
        pose.pose.position.CopyFrom(place)
        pose.pose.orientation.CopyFrom(rotation)
        yield t_ns, "/keyframes", pose
        yield (
            t_ns,
            "/motion",
            messages.KeyframeMotion(
                timestamp=_stamp(t_ns),
                v_gi=_contract_vector(v),
                b_a=_contract_vector(b_a),
                b_g=_contract_vector(b_g),
            ),
        )


def imu(
    samples: segment_pb2.MotionSegment.ImuSamples, topic: str
) -> Iterator[Timed]:
    for t_ns, gyro, accel in zip(
        samples.t_ns, _triples(samples.gyro), _triples(samples.accel)
    ):
        yield (
            t_ns,
            topic,
            messages.ImuReading(
                timestamp=_stamp(t_ns),
                gyro=_contract_vector(gyro),
                accel=_contract_vector(accel),
            ),
        )


def landmarks(segment: segment_pb2.MotionSegment) -> Iterator[Timed]:
    if not segment.landmarks.id:
        return
    number = PackedElementField_pb2.PackedElementField
    record = struct.Struct("<dddII")  # the 64 bits of an id in two parts
    t_ns = segment.keyframes.t_ns[0]
    fields = [
        number(name=name, offset=8 * i, type=number.FLOAT64)
        for i, name in enumerate("xyz")
    ]
    fields.append(number(name="id_low", offset=24, type=number.UINT32))
    fields.append(number(name="id_high", offset=28, type=number.UINT32))
    cloud = PointCloud_pb2.PointCloud(
        timestamp=_stamp(t_ns),
        frame_id="G",
        point_stride=record.size,
        fields=fields,
        data=b"".join(
            record.pack(*p, id & 0xFFFFFFFF, id >> 32)
            for id, p in zip(
                segment.landmarks.id, _triples(segment.landmarks.p_g)
            )
        ),
    )
    cloud.pose.orientation.w = 1
    yield t_ns, "/landmarks", cloud


def observations(segment: segment_pb2.MotionSegment) -> Iterator[Timed]:
    seen: dict = {}
    observations = segment.observations
    for keyframe, camera, landmark, (u, v) in zip(
        observations.keyframe,
        observations.camera,
        observations.landmark,
        zip(*[iter(observations.z_px)] * 2),
    ):
        points, ids = seen.setdefault((keyframe, camera), ([], []))
        points.append(Point2_pb2.Point2(x=u, y=v))
        ids.append(str(segment.landmarks.id[landmark]))
    for (keyframe, camera), (points, ids) in seen.items():
        t_ns = segment.keyframes.t_ns[keyframe]
        annotation = PointsAnnotation_pb2.PointsAnnotation(
            timestamp=_stamp(t_ns),
            type=PointsAnnotation_pb2.PointsAnnotation.POINTS,
            points=points,
            thickness=3,
            metadata=[
                KeyValuePair_pb2.KeyValuePair(
                    key="landmarks", value=",".join(ids)
                )
            ],
        )
        annotation.outline_color.g = annotation.outline_color.a = 1
        yield (
            t_ns,
            f"/cam{camera}/observations",
            ImageAnnotations_pb2.ImageAnnotations(
                timestamp=_stamp(t_ns), points=[annotation]
            ),
        )


# The values of an IMU whose readings need no correction, but for zeros.
_ONE = v1.Vector3(x=1, y=1, z=1)
_NOMINAL = v1.ImuCalibration(s_g=_ONE, s_a=_ONE)


def _corrections(imu: v1.ImuCalibration) -> list[str]:
    """Returns the names of the values that correct readings, but for poses of
    frames and the time offset, of which there is more to say."""
    names = []
    for field, value in imu.ListFields():
        if field.name in ("q_ai", "q_ji", "p_ji", "time_offset_s"):
            continue
        if field.message_type is not None:
            corrects = value != getattr(_NOMINAL, field.name)
        else:
            corrects = any(value if isinstance(value, Iterable) else [value])
        if corrects:
            names.append(field.name)
    return names


def losses(calibration: v1.CalibrationParameters) -> list[str]:
    lost = []
    for number, camera in enumerate(calibration.cameras):
        if camera.distortion_model not in _DISTORTION:
            name = _model_name(camera)
            lost.append(
                f"cam{number}: Foxglove's schema does not know the model; it "
                f"is named '{name}' with selfcal's coefficients as D, and "
                "viewers that project points into the image do so without "
                "distortion or not at all"
            )
        if camera.time_offset_s != 0:
            lost.append(
                f"cam{number}: the time offset of {camera.time_offset_s:g} s "
                "is not included; images keep their own timestamps"
            )
        if camera.HasField("line_delay_s"):
            lost.append(
                f"cam{number}: the line delay of {camera.line_delay_s:g} s is "
                "not included; all rows of an image have its timestamp"
            )
        if camera.HasField("time_drift"):
            lost.append(
                f"cam{number}: the drift of its clock by "
                f"{camera.time_drift:g} s each second is not included; images "
                "keep their own timestamps"
            )
        if any(
            field.name.endswith("_slope") for field, _ in camera.ListFields()
        ):
            lost.append(
                f"cam{number}: its slopes with temperature are not included; "
                "the values are those at the reference temperature"
            )
    imus = [("imu", calibration.imu)]
    if calibration.HasField("imu1"):
        imus.append(("imu1", calibration.imu1))
    for name, one in imus:
        corrected = _corrections(one)
        if corrected:
            lost.append(
                f"{name}: {', '.join(corrected)} "
                f"{'is' if len(corrected) == 1 else 'are'} not included; "
                "readings are raw"
            )
        if one.time_offset_s != 0:
            lost.append(
                f"{name}: the time offset of {one.time_offset_s:g} s is not "
                "included; readings keep their own timestamps"
            )
    return lost
