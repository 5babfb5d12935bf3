"""Model of events: registration, subscription, sending, delivery, waiting."""

from __future__ import annotations

from tests.firmware.model.calls import CALLS, SATURATED, call
from tests.firmware.model.state import Code, Condition, Error, Event, Handler, Message, Sizes, Subscription, Thread
from tests.firmware.model.threads import Step, Threads

DRIVERS = None
"""Owner of the drivers' subscriptions."""


class Events(Threads):
    """Events and messages."""

    def __init__(self, sizes: Sizes, code: Code) -> None:
        super().__init__(sizes, code)
        self.events: dict[int, Event] = {}
        self.queue: list[Message] = []
        """Messages for the next delivery."""
        self.batch: list[Message] = []
        """Messages of the current delivery that no handler has received yet."""
        self.cursor = 0
        """Position of the handler that runs, among the subscriptions of `delivering`."""
        self.delivering: Event | None = None
        self.losses: dict[int, int] = {}
        self.other_losses = 0

    # ---- Registration ----------------------------------------------------------------------------------------------

    @call("Sys_Register_Event", "MTH")
    def register(self, number: int) -> bool:
        if number not in self.events:
            if not self.allocate(self.sizes.event):
                return self.fail(Error.MEMORY)
            self.events[number] = Event(number)
        return True

    @call("Sys_Unregister_Event", "MTH")
    def unregister(self, number: int) -> bool:
        """End the event's subscriptions, drop its queued messages and wake its waiters without a result."""
        event = self.events.pop(number, None)
        if event is None:
            return self.fail(Error.EVENT)
        while event.subscriptions:
            self.remove_subscription(event, 0)
        for thread in list(self.blocked):
            if thread.awaited is event:
                self.wake(thread)
                thread.error = Error.EVENT
        for message in (*self.queue, *self.batch):
            if message.event is event:
                message.event = None  # its memory is free after its delivery
        self.free(self.sizes.event)
        return True

    @call("Sys_IsEventRegistered", "MTHI")
    def is_registered(self, number: int) -> bool:
        return number in self.events

    # ---- Subscription ----------------------------------------------------------------------------------------------

    @call("Sys_Subscribe_to_Event", "MTH")
    def subscribe(self, number: int, pid: int, handler: Handler | None, condition: Condition | None) -> bool:
        if handler is None:
            return self.fail(Error.ARGUMENT)
        if self.find(pid) is None:
            return self.fail(Error.PROCESS)
        if number not in self.events:
            return self.fail(Error.EVENT)
        return self.leave(self.add_subscription(self.events[number], pid, handler, condition))

    def add_subscription(
        self, event: Event, pid: int | None, handler: Handler, condition: Condition | None = None
    ) -> Error:
        """Add a subscription, or replace its condition. During a delivery a new one comes before the running handler:
        it gets the next message first."""
        for known in event.subscriptions:
            if known.pid == pid and known.handler is handler:
                known.condition = condition
                return Error.OK
        if not self.allocate(self.sizes.subscription):
            return Error.MEMORY
        new = Subscription(handler, pid, condition)
        if event is self.delivering:
            event.subscriptions.insert(self.cursor, new)
            self.cursor += 1
        else:
            event.subscriptions.append(new)
        return Error.OK

    @call("Sys_Unsubscribe_from_Event", "MTH")
    def unsubscribe(self, number: int, pid: int) -> bool:
        return self.remove_handlers(number, pid, None)

    @call("Sys_Unsubscribe_Handler", "MTH")
    def unsubscribe_handler(self, number: int, pid: int, handler: Handler | None) -> bool:
        return self.remove_handlers(number, pid, handler)

    def remove_handlers(self, number: int, pid: int | None, handler: Handler | None) -> bool:
        """End one subscription of a thread to an event; handler None: all of them."""
        if number not in self.events:
            return self.fail(Error.EVENT)
        found = self.remove_subscriptions(self.events[number], pid, handler)
        return found or self.fail(Error.PROCESS)

    def remove_subscriptions(self, event: Event, pid: int | None, handler: Handler | None) -> bool:
        found = False
        for one in list(event.subscriptions):
            if one.pid == pid and handler in (None, one.handler):
                self.remove_subscription(event, event.subscriptions.index(one))
                found = True
        return found

    def remove_subscription(self, event: Event, at: int) -> None:
        del event.subscriptions[at]
        if event is self.delivering and at < self.cursor:
            self.cursor -= 1
        self.free(self.sizes.subscription)

    def drop_subscriptions(self, pid: int) -> None:
        for event in self.events.values():
            self.remove_subscriptions(event, pid, None)

    # ---- Sending ---------------------------------------------------------------------------------------------------

    @call("Sys_Send_Event", "MTHI")
    def send_event(self, number: int, payload: bytes | None, size: int) -> bool:
        limit = self.sizes.small_payload if self.in_isr else self.sizes.maximum_payload
        if size > limit or (payload is None and size):
            return self.fail(Error.ARGUMENT)
        return self.send(number, payload or b"")

    @call("Sys_Send_IntEvent", "MTHI")
    def send_int(self, number: int, value: int) -> bool:
        return self.send(number, value.to_bytes(2, "little"))

    def send(self, number: int, payload: bytes) -> bool:
        """Queue a message, unless there is no listener, or a quota drops it or replaces the waiting one."""
        return self.leave(self.queue_message(number, payload))

    def announce(self, number: int, value: int) -> None:
        """Send an event of the kernel's own: a failure is no error of the caller."""
        self.queue_message(number, (value & 0xFFFF).to_bytes(2, "little"))
        self.boundary()

    def queue_message(self, number: int, payload: bytes) -> Error:
        event = self.events.get(number)
        if event is None:
            return Error.EVENT
        if self.apply_quota(event, payload) or not self.has_listener(event):
            return Error.OK
        if not self.allocate(self.sizes.message + len(payload)):
            self.lose(number)
            return Error.MEMORY
        self.queue.append(Message(event, payload))
        self.preempt()
        return Error.OK

    def has_listener(self, event: Event) -> bool:
        return bool(event.subscriptions) or any(thread.awaited is event for thread in self.blocked)

    def apply_quota(self, event: Event, payload: bytes) -> bool:
        """Whether a quota has dropped the message or stored its payload (options.py)."""
        raise NotImplementedError

    def lose(self, number: int) -> None:
        """Count a lost message: the first events that lose one have counters of their own."""
        self.events_lost = min(self.events_lost + 1, SATURATED)
        self.boundary()
        if number and (number in self.losses or len(self.losses) < self.sizes.loss_counters):
            self.losses.setdefault(number, 0)
            self.boundary()
            self.losses[number] = min(self.losses[number] + 1, SATURATED)
        else:
            self.other_losses = min(self.other_losses + 1, SATURATED)

    @call("Sys_Get_LostEvents", "MTHI")
    def lost_events(self, number: int) -> int:
        return self.losses.get(number, 0) if number else self.other_losses

    # ---- Delivery --------------------------------------------------------------------------------------------------

    @property
    def has_messages(self) -> bool:  # type: ignore[override]
        return bool(self.queue)

    def deliver_queued(self) -> None:
        """Deliver the messages queued so far; those that handlers send wait for the next delivery."""
        self.batch, self.queue = self.queue, []
        self.boundary()
        while self.batch:
            self.deliver(self.batch.pop(0))

    def deliver(self, message: Message) -> None:
        """Run the handlers, then the conditions of the waiting threads, then wake the threads that get the message."""
        event = message.event
        if event is not None:
            self.run_handlers(event, message)
            self.evaluate_conditions(event, message)
            for thread in list(self.blocked):
                if thread.awaited is event and thread.condition is None:
                    self.wake(thread, message)
                    message.readers += 1
        if not message.readers:
            self.free(self.sizes.message + len(message.payload))

    def run_handlers(self, event: Event, message: Message) -> None:
        """Call the handlers in order. Each, and each condition, may end any subscription and any thread."""
        self.delivering, self.cursor = event, 0
        while self.cursor < len(event.subscriptions):
            one = event.subscriptions[self.cursor]
            if (one.condition is None or one.condition(message)) and self.is_next(event, one):
                pid = one.pid if one.pid is not None else 0xFFFF
                if not one.handler(pid, event.number, message):
                    still = self.events.get(event.number)
                    if still is not None:
                        self.remove_subscriptions(still, one.pid, one.handler)
            if self.is_next(event, one):
                self.cursor += 1
        self.delivering = None

    def is_next(self, event: Event, one: Subscription) -> bool:
        return self.cursor < len(event.subscriptions) and event.subscriptions[self.cursor] is one

    def evaluate_conditions(self, event: Event, message: Message) -> None:
        """Evaluate each waiter's condition once. A waiter whose condition holds needs none any more."""
        self.scan = 0
        while self.scan < len(self.blocked):
            thread = self.blocked[self.scan]
            holds = thread.awaited is event and thread.condition is not None and thread.condition(message)
            if self.scan < len(self.blocked) and self.blocked[self.scan] is thread:
                if holds:
                    thread.condition = None
                self.scan += 1
        self.scan = None

    # ---- Waiting ---------------------------------------------------------------------------------------------------

    @call("Sys_Wait_for_Event", "T", None, blocks=True)
    def wait_for_event(self, number: int) -> Step:
        return self.wait(number, None, 0)

    @call("Sys_Wait_for_Condition", "T", None, blocks=True)
    def wait_for_condition(self, number: int, condition: Condition | None) -> Step:
        return self.wait(number, condition, 0)

    @call("Sys_Wait_for_ConditionTimeout", "T", None, blocks=True)
    def wait_for_condition_timeout(self, number: int, condition: Condition | None, ms: int) -> Step:
        return self.wait(number, condition, ms)

    def wait(self, number: int, condition: Condition | None, ms: int) -> Step:
        """Wait for an event and return the message; None: time-out, or the event was unregistered."""
        thread = self.running
        self.release_result(thread)
        event = self.events.get(number)
        if event is None:
            self.fail(Error.EVENT)
            return None
        thread.condition = condition
        yield from self.block(ms, event)
        return thread.result

    def clear(self, message: Message | None) -> None:
        """Free a wait result of the calling thread; do nothing in other contexts."""
        if message is not None and self.context == "T" and message is self.running.result:
            self.release_result(self.running)

    CALLS["Sys_Clear_EventData"] = "T"

    def release_result(self, thread: Thread) -> None:
        message, thread.result = thread.result, None
        if message is not None:
            message.readers -= 1
            if not message.readers:
                self.free(self.sizes.message + len(message.payload))
