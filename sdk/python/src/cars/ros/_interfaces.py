"""The services of simulation_interfaces over the controls of a run, where their types are installed."""

from __future__ import annotations

import importlib
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Optional

from ._motion import rotated

if TYPE_CHECKING:
    from ._bridge import Bridge

FEATURES = [
    "ENTITY_STATE_GETTING",
    "SIMULATION_RESET",
    "SIMULATION_STATE_GETTING",
    "SIMULATION_STATE_SETTING",
    "SIMULATION_STATE_PAUSE",
    "STEP_SIMULATION_SINGLE",
    "STEP_SIMULATION_MULTIPLE",
]
"""What simulation_interfaces/SimulatorFeatures calls what is served here."""
LIMITS = "reset has the scope ALL; entities are filtered by name only; accelerations, turns and velocities of guests are given as 0"
"""What is said of them beside."""


@dataclass(frozen=True)
class Entity:
    """A robot or a guest in one tick, in the frame ``map``."""

    name: str
    x_m: float
    y_m: float
    yaw_rad: float
    velocity_mps: tuple[float, float]
    time_ns: int
    """Time of the tick, simulated."""


class Interfaces:
    """Serves a run as that standard has it; names of the services are those of its types: ``/step_simulation``."""

    def __init__(self, bridge: Bridge) -> None:
        """Declares the services."""
        self._bridge = bridge
        self._msg: Any = importlib.import_module("simulation_interfaces.msg")
        self._srv: Any = importlib.import_module("simulation_interfaces.srv")
        # An epoch that was paused at tick 0, where a clock that is held has not been started either.
        self._paused_epoch: Optional[int] = None
        services = {
            "GetSimulatorFeatures": self._get_features,
            "GetSimulationState": self._get_state,
            "SetSimulationState": self._set_state,
            "StepSimulation": self._step,
            "ResetSimulation": self._reset,
            "GetEntities": self._get_entities,
            "GetEntityState": self._get_entity_state,
            "GetEntitiesStates": self._get_entities_states,
        }
        for name, serve in services.items():
            topic = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()
            bridge.serve(getattr(self._srv, name), f"/{topic}", serve)

    def _get_features(self, _request: Any, response: Any) -> Any:
        response.features.features = [getattr(self._msg.SimulatorFeatures, name) for name in FEATURES]
        response.features.custom_info = LIMITS
        return response

    def _get_state(self, _request: Any, response: Any) -> Any:
        status = self._bridge.control({"do": "status"})
        if self._is_done(status, response):
            response.state.state = self._state(status)
        return response

    def _set_state(self, request: Any, response: Any) -> Any:
        states, wanted = self._msg.SimulationState, request.state.state
        status = self._bridge.control({"do": "status"})
        if not self._is_done(status, response):
            return response
        if wanted == self._state(status):
            return self._answered(response, response.ALREADY_IN_TARGET_STATE, f"the run is {status['phase']} already")

        if wanted == states.STATE_STOPPED:
            answer = self._bridge.reset()
        elif wanted == states.STATE_PLAYING:
            answer = self._bridge.control({"do": "start"})
        elif wanted == states.STATE_PAUSED:
            answer = self._bridge.control({"do": "pause"})
            self._paused_epoch = status["epoch"]
        elif wanted == states.STATE_QUITTING:
            answer = self._bridge.control({"do": "stop"})
        else:
            text = f"a run cannot be brought to the state {wanted}; there are STOPPED, PLAYING, PAUSED and QUITTING"
            return self._answered(response, self._msg.Result.RESULT_FEATURE_UNSUPPORTED, text)
        self._is_done(answer, response, response.STATE_TRANSITION_ERROR)
        return response

    def _step(self, request: Any, response: Any) -> Any:
        """Exactly so many ticks, or a failure that says how many."""
        before = self._bridge.control({"do": "status"})
        if not self._is_done(before, response):
            return response
        answer = self._bridge.step(request.steps)
        if self._is_done(answer, response) and answer["tick"] - before["tick"] != request.steps:
            text = f"{answer['tick'] - before['tick']} of {request.steps} ticks: the run ended, or was controlled by others as well"
            self._answered(response, self._msg.Result.RESULT_OPERATION_FAILED, text)
        return response

    def _reset(self, request: Any, response: Any) -> Any:
        if request.scope not in (request.SCOPE_DEFAULT, request.SCOPE_ALL):
            text = f"the scope {request.scope} is not supported: a run is reset as a whole, with SCOPE_ALL"
            return self._answered(response, self._msg.Result.RESULT_FEATURE_UNSUPPORTED, text)
        self._is_done(self._bridge.reset(), response)
        return response

    def _get_entities(self, request: Any, response: Any) -> Any:
        found = self._matching(request.filters, response)
        response.entities = [entity.name for entity in found]
        return response

    def _get_entity_state(self, request: Any, response: Any) -> Any:
        entities = self._entities(response)
        found = next((entity for entity in entities if entity.name == request.entity), None)
        if found is not None:
            response.state = self._entity_state(found)
        elif response.result.result == self._msg.Result.RESULT_OK:
            self._answered(response, self._msg.Result.RESULT_NOT_FOUND, f"there is no entity {request.entity!r}")
        return response

    def _get_entities_states(self, request: Any, response: Any) -> Any:
        found = self._matching(request.filters, response)
        response.entities = [entity.name for entity in found]
        response.states = [self._entity_state(entity) for entity in found]
        return response

    def _entities(self, response: Any) -> list[Entity]:
        """Those of the last tick. If there are none to be had, the response says why."""
        frame = self._bridge.current()
        if not frame:
            self._answered(response, self._msg.Result.RESULT_OPERATION_FAILED, "there is no frame of the last tick")
            return []
        self._answered(response, self._msg.Result.RESULT_OK)
        return self._bridge.entities(frame)

    def _matching(self, filters: Any, response: Any) -> list[Entity]:
        if filters.categories or filters.tags.tags or filters.bounds.type != self._msg.Bounds.TYPE_EMPTY:
            text = "categories, tags and bounds are not supported: filter by name"
            self._answered(response, self._msg.Result.RESULT_FEATURE_UNSUPPORTED, text)
            return []
        try:
            pattern = re.compile(filters.filter)
        except re.error as error:
            text = f"{filters.filter!r} is not a regular expression: {error}"
            self._answered(response, self._msg.Result.RESULT_OPERATION_FAILED, text)
            return []
        return [entity for entity in self._entities(response) if pattern.search(entity.name)]

    def _entity_state(self, entity: Entity) -> Any:
        state = self._msg.EntityState()
        state.header.frame_id = "map"
        state.header.stamp.sec, state.header.stamp.nanosec = divmod(entity.time_ns, 10**9)
        fill_pose(state.pose, entity.x_m, entity.y_m, entity.yaw_rad)
        state.twist.linear.x, state.twist.linear.y = entity.velocity_mps
        return state

    def _state(self, status: dict[str, Any]) -> int:
        """What the standard calls the phase of a run. A run is stopped until it is played, stepped or paused."""
        states = self._msg.SimulationState
        if status["phase"] in ("gathering", "ready"):
            is_paused = status["epoch"] == self._paused_epoch
            return int(states.STATE_PAUSED if is_paused else states.STATE_STOPPED)
        named = {"running": states.STATE_PLAYING, "paused": states.STATE_PAUSED, "ended": states.STATE_QUITTING}
        return int(named[status["phase"]])

    def _is_done(self, answer: dict[str, Any], response: Any, otherwise: Optional[int] = None) -> bool:
        """Whether a control was executed; the response says so, or why it was not."""
        if answer["answer"] == "done":
            self._answered(response, self._msg.Result.RESULT_OK)
            return True
        failed = self._msg.Result.RESULT_OPERATION_FAILED if otherwise is None else otherwise
        self._answered(response, failed, answer.get("explanation", ""))
        return False

    @staticmethod
    def _answered(response: Any, result: int, text: str = "") -> Any:
        response.result.result, response.result.error_message = result, text
        return response


def fill_pose(pose: Any, x_m: float, y_m: float, yaw_rad: float) -> None:
    """Fills a geometry_msgs/Pose on the floor."""
    pose.position.x, pose.position.y = float(x_m), float(y_m)
    pose.orientation.w, pose.orientation.z = rotated(yaw_rad / 2)
