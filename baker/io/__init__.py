"""Scene files, images and JUnit reports; importers are found here."""
