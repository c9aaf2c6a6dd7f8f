"""The closed loop: a full vehicle model behind a lead, its sensors, and what becomes of a fault."""
