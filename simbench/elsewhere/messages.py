"""The messages of a recording as a file: the frames that a pipeline's process would be told, without ids."""

from __future__ import annotations

from simbench.isolate.frames import Frame, pack
from simbench.isolate.told import message_frame, reset_frame
from simbench.recording import Recording


def messages_as_bytes(recording: Recording) -> bytes:
    """`reset`, every message in order of arrival, `finish`."""
    told = [reset_frame(recording.calibration, recording.categories)]
    told += [message_frame(message) for message in recording.messages]
    return b"".join(pack(frame) for frame in (*told, Frame(kind="finish")))
