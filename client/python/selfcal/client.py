"""A connection to selfcald; see the package."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Iterable, Iterator
from typing import Callable, TypeVar

import grpc

from selfcal.v1 import (
    activity_service_pb2 as activity,
    activity_service_pb2_grpc as activity_grpc,
    calibration_service_pb2 as calibration,
    calibration_service_pb2_grpc as calibration_grpc,
    fleet_pb2 as fleet,
    fleet_pb2_grpc as fleet_grpc,
    recalibration_pb2 as recalibration,
    recalibration_pb2_grpc as recalibration_grpc,
    rig_pb2 as rig,
    rig_pb2_grpc as rig_grpc,
    segment_pb2 as segment,
    segment_pb2_grpc as segment_grpc,
    session_pb2 as session,
    session_pb2_grpc as session_grpc,
    store_service_pb2 as store,
    store_service_pb2_grpc as store_grpc,
    uplink_pb2 as uplink,
    uplink_pb2_grpc as uplink_grpc,
)

_PAGE_SIZE = 500
_MAX_MESSAGE_BYTES = 64 << 20  # limit of the daemon

_Request = TypeVar("_Request")
_Response = TypeVar("_Response")


def _parent(rig_id: str) -> str:
    """Of a list of one rig, or of all."""
    return f"rigs/{rig_id}" if rig_id else ""


@dataclasses.dataclass(frozen=True)
class Tls:
    """PEM files for a TCP target with mutual TLS."""

    ca_file: str
    certificate_file: str
    key_file: str

    def credentials(self) -> grpc.ChannelCredentials:
        return grpc.ssl_channel_credentials(
            root_certificates=pathlib.Path(self.ca_file).read_bytes(),
            private_key=pathlib.Path(self.key_file).read_bytes(),
            certificate_chain=pathlib.Path(self.certificate_file).read_bytes(),
        )


class Daemon:
    """A connection to the daemon. Lists are read page by page while they are
    iterated over.

    `timeout_s` applies to each call, except streams and watches.
    """

    def __init__(self, channel: grpc.Channel, timeout_s: float = 30) -> None:
        self._channel = channel
        self._timeout_s = timeout_s
        self.rig_service = rig_grpc.RigServiceStub(channel)
        self.segment_service = segment_grpc.SegmentServiceStub(channel)
        self.calibration_service = calibration_grpc.CalibrationServiceStub(
            channel
        )
        self.recalibration_service = (
            recalibration_grpc.RecalibrationServiceStub(channel)
        )

        self.activity_service = activity_grpc.ActivityServiceStub(channel)
        self.fleet_service = fleet_grpc.FleetServiceStub(channel)
        self.session_service = session_grpc.SessionServiceStub(channel)
        self.store_service = store_grpc.StoreServiceStub(channel)
        self.uplink_service = uplink_grpc.UplinkServiceStub(channel)

    def __enter__(self) -> Daemon:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._channel.close()

    def rigs(self) -> Iterator[rig.Rig]:
        for page in self._pages(
            self.rig_service.ListRigs, rig.ListRigsRequest()
        ):
            yield from page.rigs

    def instructions(self, rig_id: str) -> Iterator[uplink.Instruction]:
        """What a hub has the device of the rig do; newest first."""
        request = uplink.ListInstructionsRequest(parent=f"rigs/{rig_id}")
        for page in self._pages(self.uplink_service.ListInstructions, request):
            yield from page.instructions

    def segments(
        self,
        rig_id: str = "",
        *,
        filter: str = "",
        order_by: str = "",
        rig_filter: str = "",
    ) -> Iterator[segment.Segment]:
        """The segments of a rig, or of all rigs of a filter; newest first."""
        request = segment.ListSegmentsRequest(
            parent=_parent(rig_id),
            filter=filter,
            order_by=order_by,
            rig_filter=rig_filter,
        )
        for page in self._pages(self.segment_service.ListSegments, request):
            yield from page.segments

    def segment_data(
        self, rig_id: str, segment_id: str
    ) -> segment.MotionSegment:
        """Returns the data of the segment `session~index`, while it is kept."""
        return self.segment_service.GetSegmentData(
            segment.GetSegmentDataRequest(
                name=f"rigs/{rig_id}/segments/{segment_id}"
            ),
            timeout=self._timeout_s,
        )

    def tables(self, rig_id: str) -> Iterable[segment.Table]:
        request = segment.ListTablesRequest(parent=f"rigs/{rig_id}")
        return self.segment_service.ListTables(
            request, timeout=self._timeout_s
        ).tables

    def stream(
        self, requests: Iterable[segment.StreamSegmentsRequest]
    ) -> Iterator[segment.StreamSegmentsResponse]:
        """Sends segments; yields one verdict for each, in their order."""
        return self.segment_service.StreamSegments(iter(requests))

    def calibration(
        self,
        rig_id: str,
        version: str = "active",
        *,
        temperature_c: float | None = None,
    ) -> calibration.Calibration:
        """A version, at a temperature if one is given: without slopes then."""
        return self.calibration_service.GetCalibration(
            calibration.GetCalibrationRequest(
                name=f"rigs/{rig_id}/calibrations/{version}",
                temperature_c=temperature_c,
            ),
            timeout=self._timeout_s,
        )

    def calibrations(
        self,
        rig_id: str = "",
        *,
        filter: str = "",
        order_by: str = "",
        rig_filter: str = "",
    ) -> Iterator[calibration.Calibration]:
        """The versions, also rejected ones, of a rig or of all rigs of a
        filter; newest first unless `order_by` is set."""
        request = calibration.ListCalibrationsRequest(
            parent=_parent(rig_id),
            filter=filter,
            order_by=order_by,
            rig_filter=rig_filter,
        )
        for page in self._pages(
            self.calibration_service.ListCalibrations, request
        ):
            yield from page.calibrations

    def watch_calibration(
        self, rig_id: str
    ) -> Iterator[calibration.Calibration]:
        """Yields the active version at once, then each new one.

        Yields the active one again if it ceases to be trustworthy.
        """
        return self.calibration_service.WatchCalibration(
            calibration.WatchCalibrationRequest(parent=f"rigs/{rig_id}")
        )

    def cohort(self, filter: str = "", max_rigs: int = 0) -> fleet.Cohort:
        """What the calibrations of the rigs of a filter have in common."""
        return self.fleet_service.DescribeCohort(
            fleet.DescribeCohortRequest(filter=filter, max_rigs=max_rigs),
            timeout=self._timeout_s,
        )

    def cohorts(
        self, label: str = "", value: str = ""
    ) -> Iterator[fleet.CohortVersion]:
        """The newest statistics of each cohort that a hub describes, or every
        version of those of one; newest first."""
        request = fleet.ListCohortsRequest(label=label, value=value)
        for page in self._pages(self.fleet_service.ListCohorts, request):
            yield from page.cohorts

    def estimates(
        self,
        rig_id: str = "",
        *,
        component: str = "",
        only_active: bool = False,
        filter: str = "",
    ) -> Iterator[fleet.Estimate]:
        """Parameters of the versions of a rig, or of all rigs of a filter."""
        request = fleet.ListEstimatesRequest(
            parent=_parent(rig_id),
            component=component,
            only_active=only_active,
            filter=filter,
        )
        for page in self._pages(self.fleet_service.ListEstimates, request):
            yield from page.estimates

    def sessions(self, rig_id: str) -> Iterator[session.Session]:
        """By name."""
        request = session.ListSessionsRequest(parent=f"rigs/{rig_id}")
        for page in self._pages(self.session_service.ListSessions, request):
            yield from page.sessions

    def trajectory(
        self, rig_id: str, session_id: str
    ) -> Iterator[session.TrajectorySegment]:
        """The path of the device in a session, segment by segment."""
        request = session.GetTrajectoryRequest(
            name=f"rigs/{rig_id}/sessions/{session_id}"
        )
        for page in self._pages(self.session_service.GetTrajectory, request):
            yield from page.segments

    def segment_information(
        self, rig_id: str, segment_id: str
    ) -> segment.SegmentInformation:
        """The information of a segment alone about each component."""
        return self.segment_service.GetSegmentInformation(
            segment.GetSegmentInformationRequest(
                name=f"rigs/{rig_id}/segments/{segment_id}"
            ),
            timeout=self._timeout_s,
        )

    def segment_residuals(
        self, rig_id: str, segment_id: str, version: int = 0
    ) -> segment.SegmentResiduals:
        """Residuals at a version; 0: the one it was estimated with."""
        return self.segment_service.GetSegmentResiduals(
            segment.GetSegmentResidualsRequest(
                name=f"rigs/{rig_id}/segments/{segment_id}",
                calibration_version=version,
            ),
            timeout=self._timeout_s,
        )

    def events(
        self, rig_id: str = "", *, rig_filter: str = ""
    ) -> Iterator[store.Event]:
        """Oldest first, of a rig, or of all or those of a filter."""
        request = store.ListEventsRequest(
            parent=_parent(rig_id), rig_filter=rig_filter
        )
        for page in self._pages(self.store_service.ListEvents, request):
            yield from page.events

    def recalibrations(
        self,
        rig_id: str = "",
        *,
        filter: str = "",
        order_by: str = "",
        rig_filter: str = "",
    ) -> Iterator[recalibration.Recalibration]:
        """The runs of a rig, or of all rigs of a filter; newest first unless
        `order_by` is set."""
        request = recalibration.ListRecalibrationsRequest(
            parent=_parent(rig_id),
            filter=filter,
            order_by=order_by,
            rig_filter=rig_filter,
        )
        for page in self._pages(
            self.recalibration_service.ListRecalibrations, request
        ):
            yield from page.recalibrations

    def activity(self, rigs: int = 50) -> activity.ListActivityResponse:
        """Returns the current activity, for the rigs that sent last."""
        return self.activity_service.ListActivity(
            activity.ListActivityRequest(page_size=rigs),
            timeout=self._timeout_s,
        )

    def rig_activity(self) -> Iterator[activity.RigActivity]:
        """The current activity of all rigs, by name."""
        request = activity.ListActivityRequest(order_by="name")
        for page in self._pages(self.activity_service.ListActivity, request):
            yield from page.rigs

    def _pages(
        self, method: Callable[..., _Response], request: _Request
    ) -> Iterator[_Response]:
        request.page_size = _PAGE_SIZE
        while True:
            page = method(request, timeout=self._timeout_s)
            yield page
            if not page.next_page_token:
                return
            request.page_token = page.next_page_token


def connect(target: str, tls: Tls | None = None) -> Daemon:
    """Returns a client for `target`, as in gRPC: unix:/path or host:port.

    Returns at once; the first call makes the connection.
    """
    options = [("grpc.max_receive_message_length", _MAX_MESSAGE_BYTES)]
    if tls is None:
        return Daemon(grpc.insecure_channel(target, options=options))
    return Daemon(
        grpc.secure_channel(target, tls.credentials(), options=options)
    )
