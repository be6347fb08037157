% highway
