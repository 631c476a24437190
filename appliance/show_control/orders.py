"""Names of box/orders.py, for the rooms that import them from here still."""

from __future__ import annotations

from appliance.box.orders import Answer, Order, OrderInbox, OrderSender, Place

__all__ = ["Answer", "Order", "OrderInbox", "OrderSender", "Place"]
