"""The usual methods in their plainest form, to measure their losses. The engine uses none of this."""
